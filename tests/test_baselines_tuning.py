"""The search of gains: it never gets worse, it says how it was made, and it keeps what else a file holds."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from baselines.__main__ import app
from baselines.registry import POLICIES, make_policy, read_gains
from baselines.side_by_side import SideBySide
from baselines.tuning import STAGES, costs, first_gains, read, replace_section, stages, turn
from formation_env import load_scenario
from formation_env.evaluation import evaluate
from formation_env.settings import build


def test_side_by_side_is_one_after_the_other() -> None:
    """Candidates in one batch cost what each costs alone on the same seeds."""
    scenario, seeds = load_scenario("initialization"), [3, 4, 5]
    policies = [make_policy(name, scenario) for name in ("zero", "smc")]
    alone = [-evaluate(policy, scenario, seeds)["return"].mean() for policy in policies]
    np.testing.assert_allclose(costs(policies, scenario, seeds), alone, rtol=1e-12)
    assert SideBySide(policies).predict(np.zeros((4, 38), np.float32))[0].shape == (4, 3)


@pytest.mark.parametrize("name", STAGES)
def test_knobs_turn_the_gains_that_they_name(name: str) -> None:
    """A knob read back stands where it was set, the settings accept it, and what it was set from has not changed."""
    gains = first_gains(name)
    for knobs in STAGES[name]:
        decades = np.array([(knob.low + knob.high) / 2 for knob in knobs])
        turned = turn(gains, knobs, decades)
        build(POLICIES[name].Settings, turned, "turned")
        # three digits
        np.testing.assert_allclose([read(turned, knob) for knob in knobs], decades, atol=2e-3)
    assert gains == first_gains(name)


def test_transfer_stages_are_for_transfers() -> None:
    """Keeping has no transfer to search for."""
    assert len(stages("lqr_tracking", load_scenario("keeping"))) == 1
    assert len(stages("lqr_tracking", load_scenario("mission"))) == 2


def test_command_writes_gains_that_load(tmp_path: Path) -> None:
    """The file tells command, seeds and cost; the gains in it are no worse than what the search began with."""
    result = CliRunner().invoke(
        app, ["tune", "keeping", "--policy", "smc", "--episodes", "4", "--generations", "1", "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    path = tmp_path / "keeping.yaml"
    assert "python -m baselines tune keeping --policy smc --episodes 4 --generations 1" in path.read_text()
    assert "seeds 2000000 to 2000003, mean cost " in path.read_text()
    assert [file.name for file in tmp_path.iterdir()] == ["keeping.yaml"]
    scenario = load_scenario("keeping")
    default = read_gains("smc", Path(__file__).parents[1] / "configs" / "baselines" / "default.yaml")
    before, after = (make_policy("smc", scenario, gains) for gains in (default, path))
    cost_before, cost_after = costs([before, after], scenario, range(2_000_000, 2_000_004))
    assert cost_after <= cost_before + 1e-12


def test_section_is_replaced_and_the_rest_is_kept() -> None:
    """Comments of the file and other sections stay; the old comment above the section goes."""
    text = "# File.\n\n# Old.\nlqr:\n  hold: {position: [1, 1, 1]}\n  floor: 1\n\n# Other.\nsmc:\n  boundary_m: 3\n"
    new = "# New.\nlqr:\n  floor: 2\n"
    assert (
        replace_section(text, "lqr", new) == "# File.\n\n# New.\nlqr:\n  floor: 2\n\n# Other.\nsmc:\n  boundary_m: 3\n"
    )
    appended = replace_section(text, "lqr_tracking", "# New.\nlqr_tracking: {}\n")
    assert appended == f"{text}\n# New.\nlqr_tracking: {{}}\n"
    assert replace_section(appended, "lqr_tracking", "# New.\nlqr_tracking: {}\n") == appended


def test_only_policies_with_gains_can_be_tuned() -> None:
    """The message names the option and what is known."""
    result = CliRunner().invoke(app, ["tune", "keeping", "--policy", "zero"])
    assert result.exit_code == 2
    assert "no gains to search" in result.output
