"""Policies by name, and where their settings come from. To add a policy: a file, and its class in `POLICIES`."""

import warnings
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from baselines.controllers.deadband import Deadband
from baselines.controllers.lqr import LQR
from baselines.controllers.lqr_finite import LQRFinite
from baselines.controllers.lqr_nominal import LQRNominal
from baselines.controllers.lqr_quasi_static import LQRQuasiStatic
from baselines.controllers.mpc import MPC
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.reference_policies import Random, Zero
from baselines.controllers.smc import SMC
from baselines.controllers.two_impulse import TwoImpulsePolicy
from formation_env.settings import ConfigError, build, load_yaml, nearest
from formation_env.task.loading import ENV_IDS, config_folder, load_scenario, scenario_names
from formation_env.task.scenario import Scenario

_CLASSES: Final[tuple[type[AccelerationPolicy], ...]] = (
    LQR,
    LQRNominal,
    MPC,
    LQRFinite,
    LQRQuasiStatic,
    SMC,
    TwoImpulsePolicy,
    Deadband,
    Zero,
    Random,
)
POLICIES: Final[dict[str, type[AccelerationPolicy]]] = {each.name: each for each in _CLASSES}
"""Classes made with (scenario, settings), the settings being of the class's `Settings`."""
FORMER_NAMES: Final = {"lqr_planned": "lqr_nominal", "lqr_tracking": "lqr_quasi_static"}
"""Names of earlier versions; the error for one gives the name of now."""
COARSE_THRUST: Final = 0.1
"""Minimum thrust over the limit from which on proportional laws are warned of: in keeping `lqr` errs 4 times as far."""


def register_policy(policy: type[AccelerationPolicy]) -> type[AccelerationPolicy]:
    """Add a policy class from outside the package; may be used as a decorator.

    Reports fly policies in other processes, so the class must be registered when its module is imported.

    Raises:
        ValueError: the name is taken by another class, or is missing.
    """
    name = getattr(policy, "name", None)
    if not isinstance(name, str) or not hasattr(policy, "Settings"):
        raise ValueError(f"{policy.__name__}: a policy class needs the attributes name and Settings")
    if POLICIES.setdefault(name, policy) is not policy:
        raise ValueError(f"{policy.__name__}: the name {name!r} is taken by {POLICIES[name].__name__}")
    return policy


def slow_policies() -> tuple[str, ...]:
    """Names of the policies that solve a program at each step."""
    return tuple(name for name, policy in POLICIES.items() if policy.slow)


def reference_policies() -> tuple[str, ...]:
    """Names of the reference policies that every controller should beat."""
    return tuple(name for name, policy in POLICIES.items() if policy.is_reference)


def make_policy(
    name: str, scenario: str | Path | Scenario, settings: Mapping[str, Any] | str | Path | object | None = None
) -> AccelerationPolicy:
    """A policy for a scenario.

    Args:
        name: one of `POLICIES`.
        scenario: a registered id, a scenario's name, the path of a YAML file, or a Scenario.
        settings: the policy's settings: an object of its `Settings`, a mapping of its keys, or the path of a YAML file
            with a section of the policy's name. By default those of `settings_path`.

    Raises:
        ConfigError: no such policy or scenario, or wrong settings; one line that names file and key.
    """
    kind = policy_class(name)
    if settings is None:
        settings = settings_path(scenario)
    if isinstance(settings, (str, Path)):
        settings = read_settings(name, Path(settings))
    elif not isinstance(settings, kind.Settings):
        settings = build(kind.Settings, settings, f"settings of {name}")
    loaded = load_scenario(scenario)
    _warn_of_coarse_thrust(kind, loaded)
    return kind(loaded, settings)


def policy_class(name: str) -> type[AccelerationPolicy]:
    """The class of a policy.

    Raises:
        ConfigError: there is none of that name; one line with its nearest neighbour.
    """
    if name not in POLICIES:
        raise ConfigError(f"no policy named {name!r}; {_hint(name)}")
    return POLICIES[name]


def _hint(name: str) -> str:
    """The new name of a renamed policy, or the nearest neighbour of a misspelt one."""
    return f"now {FORMER_NAMES[name]}" if name in FORMER_NAMES else nearest(name, POLICIES)


def _warn_of_coarse_thrust(kind: type[AccelerationPolicy], scenario: Scenario) -> None:
    """Warn if a proportional policy is made for a thruster that gives no small thrusts."""
    craft = scenario.spacecraft
    if kind.proportional and craft.min_accel_m_s2 >= COARSE_THRUST * craft.max_accel_m_s2:
        warnings.warn(
            f"{kind.name}: commands thrust in proportion to the error, but the thruster gives none below "
            f"spacecraft.min_accel_m_s2 = {craft.min_accel_m_s2:g} (max_accel_m_s2 = {craft.max_accel_m_s2:g}), so "
            "small errors are left to grow; use deadband, two_impulse or mpc",
            UserWarning,
            stacklevel=3,
        )


def settings_path(scenario: str | Path | Scenario) -> Path:
    """The settings file for a scenario.

    For a scenario file `my.yaml` it is `my.baselines.yaml` beside it, if that exists. Else it is the file in
    configs/baselines of the shipped scenario that equals this one, else default.yaml.
    """
    if not isinstance(scenario, Scenario):
        beside = settings_beside(scenario)
        if beside is not None and beside.is_file():
            return beside
    folder = config_folder("baselines")
    name = ENV_IDS.get(scenario, scenario) if isinstance(scenario, str) else scenario
    if name not in scenario_names():
        loaded = load_scenario(name)
        name = next((known for known, shipped in _shipped_scenarios().items() if shipped == loaded), "default")
    path = folder / f"{name}.yaml"
    return path if path.is_file() else folder / "default.yaml"


def settings_beside(scenario: str | Path) -> Path | None:
    """Settings file of a user's scenario file, `STEM.baselines.yaml` beside it; None for a name or an id."""
    path = Path(scenario)
    shipped = path.parent.resolve() == config_folder("scenarios").resolve()
    if path.suffix not in (".yaml", ".yml") or shipped:
        return None
    return path.with_name(f"{path.stem}.baselines.yaml")


@lru_cache(maxsize=1)
def _shipped_scenarios() -> dict[str, Scenario]:
    """The scenarios that come with the package, by name."""
    return {name: load_scenario(name) for name in scenario_names()}


def read_settings(name: str, path: Path) -> Any:
    """Settings of a policy from a settings file; if it has no section of that name, the policy's defaults.

    Raises:
        ConfigError: the file is missing, or a section or key in it is wrong.
    """
    sections = load_yaml(path)
    if not isinstance(sections, Mapping):
        raise ConfigError(f"{path}: (top level): must be a mapping of policies, got {str(sections)[:80]}")
    for section in sections:
        if section not in POLICIES:
            raise ConfigError(f"{path}: {section}: no policy of that name; {_hint(str(section))}")
    return build(policy_class(name).Settings, sections.get(name, {}), f"{path}: {name}")
