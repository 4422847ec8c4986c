"""Policies state themselves: one from outside is flown, drawn and tuned as those of the package are."""

import dataclasses
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from baselines import POLICIES, make_policy, register_policy
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import reference_policies, settings_beside, settings_path, slow_policies
from baselines.controllers.search_space import Parameter
from baselines.experiments.policy_factories import classical
from baselines.report.style import Look, looks
from formation_env import ConfigError, load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import Positive, build, load_yaml, settings
from formation_env.task.loading import config_folder
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario


@settings
class DampingSettings:
    """Settings of `damping`."""

    rate_per_s: Positive = 1e-3


class Damping(AccelerationPolicy):
    """Thrust against the velocity error."""

    name = "damping"
    Settings = DampingSettings
    settings: DampingSettings
    search_space = (Parameter(("rate_per_s",), 1e-4, 1e-2),)
    color, symbol = "#009E73", "star"

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        error: Array = observation_layout(self.scenario).state(observation, "error")
        return -self.settings.rate_per_s * error[..., 3:]


@pytest.fixture
def damping() -> Iterator[type[AccelerationPolicy]]:
    """The policy from outside, registered for one test."""
    yield register_policy(Damping)
    del POLICIES["damping"]


@pytest.mark.usefixtures("damping")
def test_a_policy_from_outside_is_one_class(tmp_path: Path) -> None:
    """It flies, differently by its settings from any source, has factory and look, and its file sections are known."""
    assert POLICIES["damping"] is Damping
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=240.0)
    weak, strong = (make_policy("damping", scenario, {"rate_per_s": rate}) for rate in (1e-4, 1e-2))
    returns = [evaluate(policy, scenario, [0, 1])["return"] for policy in (weak, strong)]
    assert np.isfinite(returns).all()
    assert (returns[0] != returns[1]).all()
    path = tmp_path / "own.yaml"
    path.write_text("damping: {rate_per_s: 5e-3}\n")
    assert make_policy("damping", scenario, path).settings == DampingSettings(rate_per_s=5e-3)
    assert make_policy("damping", scenario).settings == DampingSettings()
    assert classical()["damping"](scenario, scenario).settings == DampingSettings()
    assert looks(["damping"])["damping"] == Look("#009E73", "star", "solid")
    with pytest.raises(ConfigError, match="settings of damping: rate_per_s: must be greater than 0"):
        make_policy("damping", scenario, {"rate_per_s": -1.0})


@pytest.mark.usefixtures("damping")
def test_a_name_is_taken_once() -> None:
    """Registering a class again changes nothing; another of its name, or one without a name, is refused."""
    register_policy(Damping)
    other = type("Other", (Damping,), {})
    with pytest.raises(ValueError, match="Other: the name 'damping' is taken by Damping"):
        register_policy(other)
    with pytest.raises(ValueError, match="needs the attributes name and Settings"):
        register_policy(type("Nameless", (AccelerationPolicy,), {}))


def test_classes_state_what_was_known_of_them() -> None:
    """Slow and reference policies, the order of the registry, and looks that differ."""
    assert slow_policies() == ("mpc",)
    assert reference_policies() == ("zero", "random")
    assert all(POLICIES[name].library == "clarabel" for name in ("mpc", "lqr_nominal"))
    assert [name for name, policy in POLICIES.items() if policy.library] == ["lqr_nominal", "mpc"]
    assert all(name == policy.name for name, policy in POLICIES.items())
    assert len({(look.symbol, look.dash) for look in looks(POLICIES).values()}) == len(POLICIES)


@pytest.mark.parametrize("name", [name for name, policy in POLICIES.items() if policy.search_space])
def test_search_spaces_are_settings_of_the_policy(name: str) -> None:
    """Each dotted key is in default.yaml, and the policy accepts both limits."""
    section = load_yaml(config_folder("baselines") / "default.yaml")[name]
    for parameter in POLICIES[name].search_space:
        assert parameter.low < parameter.high
        for key in parameter.keys:
            *parents, last = [int(part) if part.isdigit() else part for part in key.split(".")]
            place = section
            for part in parents:
                place = place[part]
            for limit in (parameter.low, parameter.high):
                place[last] = limit
                build(POLICIES[name].Settings, section, name)


def user_scenario(folder: Path) -> Path:
    """A scenario file of a user's own."""
    path = folder / "my.yaml"
    shipped = config_folder("scenarios") / "keeping.yaml"
    path.write_text(shipped.read_text(encoding="utf-8") + "tolerance_m: 44\n", encoding="utf-8")
    return path


def test_settings_beside_a_users_scenario_are_used(tmp_path: Path) -> None:
    """By make_policy and by the report's factories, which are given the loaded scenario; else default.yaml."""
    scenario = user_scenario(tmp_path)
    assert settings_path(scenario).name == "default.yaml"
    beside = settings_beside(scenario)
    assert beside == tmp_path / "my.baselines.yaml"
    beside.write_text("# Übung\nsmc: {boundary_m: 7}\n", encoding="utf-8")
    assert settings_path(str(scenario)) == beside
    assert make_policy("smc", scenario).settings.boundary_m == 7
    loaded = load_scenario(scenario)
    (factory,) = classical(["smc"], ["keeping", str(scenario)]).values()
    assert factory(loaded, loaded).settings.boundary_m == 7
    other = load_scenario("keeping")
    assert factory(other, other).settings == make_policy("smc", "keeping").settings
    beside.write_text("smc: {boundary: 7}\n")
    with pytest.raises(ConfigError, match=r"my\.baselines\.yaml: smc: boundary: unknown key"):
        make_policy("smc", scenario)


def test_shipped_scenarios_have_no_settings_beside_them() -> None:
    """Theirs are in configs/baselines, by whatever name they are given."""
    assert settings_beside("keeping") is None
    assert settings_beside("FormationKeeping-v0") is None
    assert settings_beside(config_folder("scenarios") / "keeping.yaml") is None
    assert settings_path(config_folder("scenarios") / "keeping.yaml").name == "keeping.yaml"


def test_renamed_keys_name_the_new_one() -> None:
    """For one minor version."""
    for name in ("two_impulse", "deadband"):
        with pytest.raises(ConfigError, match=f"settings of {name}: keeping: now station_keeping"):
            make_policy(name, "keeping", {"keeping": {"band_m": 3.0}})


@pytest.mark.parametrize(("former", "new"), [("lqr_planned", "lqr_nominal"), ("lqr_tracking", "lqr_quasi_static")])
def test_former_names_give_the_new_ones(former: str, new: str, tmp_path: Path) -> None:
    """As a policy, and as a section of a settings file."""
    with pytest.raises(ConfigError, match=f"no policy named '{former}'; now {new}"):
        make_policy(former, "keeping")
    path = tmp_path / "own.yaml"
    path.write_text(f"{former}: {{}}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=f"own.yaml: {former}: no policy of that name; now {new}"):
        make_policy("lqr", "keeping", path)


def test_settings_files_are_utf_8_in_every_locale(tmp_path: Path) -> None:
    """Adding a section keeps the comments, even where the locale knows ASCII only."""
    path = tmp_path / "own.yaml"
    path.write_text("# Größe\nlqr:\n  deadband: 0.1\n", encoding="utf-8")
    code = "from pathlib import Path; import sys; from baselines.tuning.settings_file import write_section; "
    code += "write_section(Path(sys.argv[1]), 'smc', {'boundary_m': 3.0}, 'new')"
    environment = {"LC_ALL": "POSIX", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONPATH": ":".join(sys.path)}
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, env=environment)
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# Größe\n")
    assert "smc:" in text


def on_off(scenario: Scenario) -> Scenario:
    """The scenario with a thruster that gives its full thrust or none."""
    craft = scenario.spacecraft
    return dataclasses.replace(scenario, spacecraft=dataclasses.replace(craft, min_accel_m_s2=craft.max_accel_m_s2))


@pytest.mark.parametrize("name", ["lqr", "lqr_finite", "lqr_quasi_static", "smc"])
def test_proportional_laws_warn_of_an_on_off_thruster(name: str) -> None:
    """One line that names policy, keys and a remedy."""
    scenario = on_off(dataclasses.replace(load_scenario("keeping"), dt_s=240.0))
    with pytest.warns(
        UserWarning, match=rf"^{name}: .* spacecraft\.min_accel_m_s2 = 0\.002 .* use deadband, two_impulse or mpc"
    ) as caught:
        make_policy(name, scenario)
    assert len(caught) == 1
    assert caught[0].filename == __file__


def test_other_laws_do_not() -> None:
    """Nor do proportional ones where the minimum thrust is small; what is warned of is real, what is named helps."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=240.0)
    weak = dataclasses.replace(scenario, spacecraft=dataclasses.replace(scenario.spacecraft, min_accel_m_s2=1e-4))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_policy("lqr", weak)
        for name in ("mpc", "two_impulse", "deadband", "zero"):
            make_policy(name, on_off(scenario))


@pytest.mark.filterwarnings("ignore:lqr")
def test_the_warning_is_right() -> None:
    """With an on/off thruster `lqr` errs ten times as far as before, a deadband less than twice."""
    scenario = load_scenario("keeping")
    errors = {
        (name, craft): evaluate(make_policy(name, flown), flown, [0, 1])["position_error_mean_m"].mean()
        for name in ("lqr", "deadband")
        for craft, flown in (("throttled", scenario), ("on/off", on_off(scenario)))
    }
    assert errors["lqr", "on/off"] > 10 * errors["lqr", "throttled"]
    assert errors["deadband", "on/off"] < 2 * errors["deadband", "throttled"]
