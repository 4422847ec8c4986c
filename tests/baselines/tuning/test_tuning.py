"""Search of settings: it never gets worse, it can be interrupted and continued, and it says how it was made."""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from optuna.trial import FrozenTrial
from typer.testing import CliRunner

from baselines.cli import app
from baselines.cli_tune import make_task as task
from baselines.cli_tune import settings_file
from baselines.controllers.registry import POLICIES, make_policy, read_settings
from baselines.experiments.policy_batch import PolicyBatch
from baselines.tuning import study
from baselines.tuning.journal import open_study
from baselines.tuning.search_space import (
    SEARCH_SPACES,
    apply,
    current_values,
    default_settings,
    search_space,
    values_in_use,
)
from baselines.tuning.settings_file import replace_section
from baselines.tuning.study import TuningTask, costs, search
from formation_env import load_scenario
from formation_env.evaluation import rollout
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError, build, load_yaml
from formation_env.task.loading import config_folder

BOTTOM = {"reweighted_lqg.floor": 7e-4, "reweighted_lqg.error_weight_scale": 0.6, "deadband": 0.3}
"""Where the bowl has its least value, 0."""


def bowl(self: TuningTask, batch: list[dict[str, float]]) -> Array:
    """Squared distances from the bottom, in decades, or as they are: a cost in closed form for `lqr`."""
    log = {knob.name: knob.log for knob in self.parameters}
    off = [[np.log10(each[k] / at) if log[k] else each[k] - at for k, at in BOTTOM.items()] for each in batch]
    return (np.array(off) ** 2).sum(axis=1)


@pytest.fixture
def lqr(monkeypatch: pytest.MonkeyPatch) -> TuningTask:
    """A search for `lqr` whose candidates cost what the bowl says."""
    monkeypatch.setattr(TuningTask, "costs", bowl)
    return task("lqr", "keeping", 4)


def kept(task: TuningTask, journal: Path) -> list[FrozenTrial]:
    """The trials in a journal."""
    return open_study(task.identity, journal).get_trials()


def numbers(trials: list[FrozenTrial]) -> list[list[Any]]:
    """What must be the same in two studies."""
    return [[trial.number, trial.value, *trial.params.values()] for trial in trials]


def tune(*arguments: str | Path) -> Any:
    """The command line's result."""
    return CliRunner().invoke(app, ["tune", *map(str, arguments)])


def test_side_by_side_is_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Candidates in one batch, or in several as for many episodes, cost what each costs alone on the same seeds."""
    scenario, flown = load_scenario("initialization"), [3, 4, 5]
    policies = [make_policy(name, scenario) for name in ("zero", "smc", "lqr")]
    alone = [-evaluate(policy, scenario, flown)["return"].mean() for policy in policies]
    np.testing.assert_allclose(costs(policies, scenario, flown), alone, rtol=1e-12)
    assert PolicyBatch(policies).predict(np.zeros((6, 38), np.float32))[0].shape == (6, 3)
    for module in (rollout, study):
        monkeypatch.setattr(module, "MAX_ROWS", 7)
    np.testing.assert_allclose(costs(policies, scenario, flown), alone, rtol=1e-12)


@pytest.mark.parametrize("name", SEARCH_SPACES)
def test_knobs_turn_the_gains_that_they_name(name: str) -> None:
    """A knob read back stands where it was set, the settings accept its limits, and the original has not changed."""
    gains, knobs = default_settings(name), SEARCH_SPACES[name]
    for values in ({knob.name: knob.low for knob in knobs}, {knob.name: knob.high for knob in knobs}):
        turned = apply(gains, knobs, values)
        build(POLICIES[name].Settings, turned, "turned")
        assert current_values(turned, knobs) == values
    assert gains == default_settings(name)


@pytest.mark.parametrize("name", SEARCH_SPACES)
def test_the_first_trial_is_the_default_gains_themselves(name: str) -> None:
    """They lie within the knobs' limits, and turning the knobs to where they stand changes nothing."""
    gains, knobs = default_settings(name), SEARCH_SPACES[name]
    assert apply(gains, knobs, current_values(gains, knobs)) == gains
    assert study.candidates(task(name, "mission", 2), [])[0] == current_values(gains, knobs)
    assert all(knob.low <= current_values(gains, knobs)[knob.name] <= knob.high for knob in knobs)


def test_knobs_of_a_transfer_are_for_transfers() -> None:
    """Keeping has no transfer to search for."""
    assert len(search_space("lqr_quasi_static", load_scenario("keeping"))) == 5
    assert len(search_space("lqr_quasi_static", load_scenario("mission"))) == 10


def test_search_finds_the_bottom(lqr: TuningTask, tmp_path: Path) -> None:
    """TPE gets far nearer to a known bottom than chance.

    The knobs span 3 decades by 1 by 1, so the nearest of 150 random points is within r with probability
    1 - exp(-150 (4/3 pi r^3) / 3): 5 % for the bound.
    """
    found = search(lqr, 150, tmp_path / "j")
    assert found.cost < (-np.log(0.95) * 3 / 150 / (4 / 3 * np.pi)) ** (2 / 3)
    (reached,) = bowl(lqr, [current_values(found.settings, lqr.parameters)])
    # the gains are those of the best trial, to three digits: half a percent is 0.002 decades
    assert abs(np.sqrt(reached) - np.sqrt(found.cost)) < 0.004
    assert found.first_cost == pytest.approx(bowl(lqr, [current_values(lqr.settings, lqr.parameters)])[0], rel=1e-12)


@pytest.mark.parametrize("stop", [1, 5, 8, 13])
def test_a_stopped_search_goes_on_as_if_it_had_not_been(lqr: TuningTask, tmp_path: Path, stop: int) -> None:
    """Stopped within a batch or after one: number by number what one go finds, and nothing is tried twice."""
    search(lqr, 21, tmp_path / "one")
    search(lqr, stop, tmp_path / "two")
    assert len(kept(lqr, tmp_path / "two")) == stop
    found = search(lqr, 21, tmp_path / "two")
    one, two = numbers(kept(lqr, tmp_path / "one")), numbers(kept(lqr, tmp_path / "two"))
    assert one == two
    assert len({tuple(trial[2:]) for trial in two}) == 21
    assert search(lqr, 21, tmp_path / "one") == found
    # asked for fewer, it is what fewer would have found
    assert search(lqr, stop, tmp_path / "two") == search(lqr, stop, tmp_path / "three")


def test_what_is_known_is_not_flown_again(lqr: TuningTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finished study costs nothing, and its progress is there at once; a torn last line costs its trial alone."""
    found = search(lqr, 10, tmp_path / "j")
    with (tmp_path / "j").open("ab") as file:
        file.write(b'{"op_code":4,"wor')
    flown: list[int] = []
    monkeypatch.setattr(TuningTask, "costs", lambda self, batch: flown.append(len(batch)) or bowl(self, batch))
    told: list[int] = []
    assert search(lqr, 10, tmp_path / "j", told.append) == found
    assert (flown, told) == ([], [10])
    search(lqr, 12, tmp_path / "j", told.append)
    assert (flown, told) == ([2], [10, 10, 2])


def test_a_study_goes_on_with_its_own_task_only(lqr: TuningTask, tmp_path: Path) -> None:
    """Other seeds, another scenario or policy: another study, even in the same file."""
    search(lqr, 3, tmp_path / "j")
    others = [task("lqr", "keeping", 5), task("lqr", "mission", 4), task("smc", "keeping", 4)]
    assert len({repr(each.identity) for each in (lqr, *others)}) == 4
    assert all(kept(other, tmp_path / "j") == [] for other in others)
    assert task("lqr", "keeping", 4).identity == lqr.identity


def test_command_writes_gains_that_load_and_are_no_worse(tmp_path: Path) -> None:
    """The file tells command, seeds and cost; flown again, its gains cost that, and no more than the default ones."""
    folders = ("--out", tmp_path / "out", "--studies", tmp_path / "studies")
    result = tune("keeping", "--policy", "smc", "--episodes", 4, "--trials", 10, *folders)
    assert result.exit_code == 0, result.output
    (path,) = (tmp_path / "out").iterdir()
    assert path.name == "keeping.yaml"
    assert "formation-env baselines tune keeping --policy smc --trials 10 --episodes 4\n" in path.read_text()
    scenario = load_scenario("keeping")
    default = read_settings("smc", Path(__file__).parents[3] / "configs" / "baselines" / "default.yaml")
    both = [make_policy("smc", scenario, gains) for gains in (default, path)]
    before, after = costs(both, scenario, range(2_000_000, 2_000_004))
    assert after <= before
    assert f"# seeds 2000000 to 2000003, mean cost {after:.4f} m/s (trial " in path.read_text()
    assert f"default settings {before:.4f} m/s)" in path.read_text()
    (journal,) = (tmp_path / "studies").iterdir()
    assert journal.name == "keeping_smc.journal"


def test_slow_policies_have_a_budget_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One command searches all of them, each with its number of trials and of seeds, and the file says which."""
    flown = list[tuple[str, int, int]]()

    def costs(self: TuningTask, batch: list[dict[str, float]]) -> Array:
        flown.append((self.policy, len(self.episode_seeds), len(batch)))
        return np.arange(len(batch), dtype=float)

    monkeypatch.setattr(TuningTask, "costs", costs)
    budget = ("--trials", 6, "--episodes", 5, "--slow-trials", 3, "--slow-episodes", 2)
    folders = ("--out", tmp_path, "--studies", tmp_path / "studies")
    result = tune("keeping", "--policy", "smc", "--policy", "mpc", *budget, *folders)
    assert result.exit_code == 0, result.output
    assert flown == [("smc", 5, 6), ("mpc", 2, 3)]
    text = (tmp_path / "keeping.yaml").read_text()
    assert "tune keeping --policy mpc --slow-trials 3 --slow-episodes 2\n" in text
    assert "tune keeping --policy smc --trials 6 --episodes 5\n" in text


def test_interrupt_ends_in_one_line_and_keeps_the_trials(
    lqr: TuningTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is written but the study, and the same command ends as if it had not been interrupted."""

    def interrupted(self: TuningTask, batch: list[dict[str, float]]) -> Array:
        if len(kept(self, tmp_path / "keeping_lqr.journal")) >= 8:
            raise KeyboardInterrupt
        return bowl(self, batch)

    options = ("keeping", "--policy", "lqr", "--episodes", 4, "--trials", 20, "--studies", tmp_path)
    monkeypatch.setattr(TuningTask, "costs", interrupted)
    result = tune(*options, "--out", tmp_path / "out")
    assert result.exit_code == 130
    assert len(result.stderr.splitlines()) == 1
    assert "interrupted" in result.stderr
    assert len(kept(lqr, tmp_path / "keeping_lqr.journal")) == 8
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr(TuningTask, "costs", bowl)
    assert tune(*options, "--out", tmp_path / "out").exit_code == 0
    search(lqr, 20, tmp_path / "whole")
    assert numbers(kept(lqr, tmp_path / "keeping_lqr.journal")) == numbers(kept(lqr, tmp_path / "whole"))


def test_gains_are_tuned_on_seeds_of_their_own() -> None:
    """No report, no choice among models and no training uses an episode that gains were tuned on."""
    tuning = task("smc", "keeping", 1_000_000).episode_seeds
    for split in ("test", "validation", "training"):
        other = seeds(split, 1_000_000)
        assert tuning[-1] < other[0] or other[-1] < tuning[0]


def test_section_is_replaced_and_the_rest_is_kept() -> None:
    """Comments of the file and other sections stay; the old comment above the section goes."""
    text = "# File.\n\n# Old.\nlqr:\n  hold: {position: [1, 1, 1]}\n  floor: 1\n\n# Other.\nsmc:\n  boundary_m: 3\n"
    new = "# New.\nlqr:\n  floor: 2\n"
    assert (
        replace_section(text, "lqr", new) == "# File.\n\n# New.\nlqr:\n  floor: 2\n\n# Other.\nsmc:\n  boundary_m: 3\n"
    )
    appended = replace_section(text, "lqr_quasi_static", "# New.\nlqr_quasi_static: {}\n")
    assert appended == f"{text}\n# New.\nlqr_quasi_static: {{}}\n"
    assert replace_section(appended, "lqr_quasi_static", "# New.\nlqr_quasi_static: {}\n") == appended


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("keeping", "--policy", "zero"), "--policy: 'zero' has no settings to search"),
        (("keepin", "--policy", "lqr"), "did you mean 'keeping'?"),
        (("none.yaml", "--policy", "lqr"), "none.yaml"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments: tuple[str, ...], told: str, tmp_path: Path) -> None:
    """What is wrong, before anything is flown or written."""
    result = tune(*arguments, "--out", tmp_path, "--studies", tmp_path)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert told in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["{", "gains\n", '{"op_code":0}\n', '{"op_code":4,\n{"op_code":4}\n'])
def test_other_files_are_no_journals(lqr: TuningTask, tmp_path: Path, text: str) -> None:
    """The message names the file, and unless it is a journal's torn beginning the file stays as it was."""
    (tmp_path / "j").write_text(text)
    if text == "{":
        assert search(lqr, 1, tmp_path / "j").trial == 0
        return
    with pytest.raises(ConfigError, match=r"j: no Optuna journal, or damaged"):
        search(lqr, 1, tmp_path / "j")
    assert (tmp_path / "j").read_text() == text


def test_without_optuna_the_extra_is_named(lqr: TuningTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command says what to install."""
    monkeypatch.setitem(sys.modules, "optuna", None)
    result = tune("keeping", "--policy", "lqr", "--out", tmp_path, "--studies", tmp_path)
    assert result.exit_code == 2
    assert result.stderr.splitlines() == ["error: needs optuna; in a checkout: pip install -e '.[optimal]', or make"]


def test_gains_in_use_are_tried_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file whose gains are the bowl's bottom keeps them, whatever the other trials; a limit of a knob is kept to."""
    monkeypatch.setattr(TuningTask, "costs", bowl)
    path = tmp_path / "keeping.yaml"
    path.write_text("lqr: {deadband: 0.3, reweighted_lqg: {floor: 7e-4, error_weight_scale: 0.6}}\n")
    folders = ("--out", tmp_path, "--studies", tmp_path / "studies")
    result = tune("keeping", "--policy", "lqr", "--trials", 12, *folders)
    assert result.exit_code == 0, result.output
    assert "(trial 1; " in result.output
    assert current_values(load_yaml(path)["lqr"], SEARCH_SPACES["lqr"]) == BOTTOM
    path.write_text("lqr: {deadband: 0.3, reweighted_lqg: {floor: 1e-9, error_weight_scale: 0.6}}\n")
    assert values_in_use("lqr", path, SEARCH_SPACES["lqr"]) == {**BOTTOM, "reweighted_lqg.floor": 1e-5}
    assert values_in_use("lqr", tmp_path / "none.yaml", SEARCH_SPACES["lqr"]) is None


def test_a_damaged_journal_is_refused_or_harmless(lqr: TuningTask, tmp_path: Path) -> None:
    """One byte flipped anywhere: an error that names the file, or the trials are those that were written.

    The date of a trial and the name of a process carry no result; all else does. A trial that is lost at the end is
    flown again.
    """
    search(lqr, 10, tmp_path / "whole")
    written, text = numbers(kept(lqr, tmp_path / "whole")), (tmp_path / "whole").read_bytes()
    rng, refused = np.random.default_rng(0), 0
    positions = rng.choice(len(text), 120, replace=False)
    for position in positions:
        damaged = bytearray(text)
        damaged[position] ^= 1 << int(rng.integers(7))
        path = tmp_path / f"damaged{position}"
        path.write_bytes(damaged)
        try:
            read = numbers(kept(lqr, path))
        except ConfigError as error:
            refused += str(error).startswith(f"{path}: no Optuna journal, or damaged")
        else:
            assert read == written[: len(read)], damaged[max(0, position - 40) : position + 40]
    assert refused > 60


def test_an_edited_cost_is_refused(lqr: TuningTask, tmp_path: Path) -> None:
    """Valid JSON with another number in it, which Optuna takes as it is."""
    result = search(lqr, 3, tmp_path / "j")
    text = (tmp_path / "j").read_text()
    assert repr(result.cost) in text
    (tmp_path / "j").write_text(text.replace(repr(result.cost), repr(result.cost / 2)))
    with pytest.raises(ConfigError, match="j: no Optuna journal, or damaged"):
        search(lqr, 3, tmp_path / "j")


def test_a_study_under_another_name_is_refused(lqr: TuningTask, tmp_path: Path) -> None:
    """The identity in the journal is that of its name: policy, scenario, seeds, settings and search space."""
    search(lqr, 2, tmp_path / "j")
    text = (tmp_path / "j").read_text()
    assert '"first_seed": 2000000' in text or '"first_seed":2000000' in text
    (tmp_path / "j").write_text(re.sub(r'("first_seed": ?)2000000', r"\g<1>2000001", text))
    with pytest.raises(ConfigError, match="j: no Optuna journal, or damaged"):
        search(lqr, 2, tmp_path / "j")


def test_settings_of_a_users_scenario_stand_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`tune mine.yaml` writes mine.baselines.yaml, and nothing in the package or in configs/."""
    monkeypatch.setattr(TuningTask, "costs", bowl)
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("phases: [{formation: {kind: following, y0_m: -100}, hold_orbits: 0.1}]\n")
    folder = config_folder("baselines")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    result = tune(scenario, "--policy", "lqr", "--trials", 3, "--studies", tmp_path / "studies")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.baselines.yaml", "mine.yaml", "studies"]
    assert "lqr" in load_yaml(tmp_path / "mine.baselines.yaml")
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_an_installed_package_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings of shipped scenarios change in a checkout only; elsewhere --out must say where they go."""
    assert settings_file("keeping", None) == config_folder("baselines") / "keeping.yaml"
    assert settings_file("FormationKeeping-v0", None) == config_folder("baselines") / "keeping.yaml"
    monkeypatch.setattr("baselines.cli_tune.is_checkout", lambda: False)
    result = tune("keeping", "--policy", "lqr", "--studies", tmp_path)
    assert result.exit_code == 2
    assert result.stderr == "error: tune: keeping: its settings belong to the installed package; give --out FOLDER\n"
    assert settings_file("keeping", tmp_path) == tmp_path / "keeping.yaml"
    assert settings_file("mine.yaml", tmp_path) == tmp_path / "mine.yaml"
