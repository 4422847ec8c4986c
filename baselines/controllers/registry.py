"""Policies by name, and where their gains come from. To add a policy: a file, and a line in `POLICIES`."""

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

POLICIES: Final[dict[str, type[Any]]] = {
    "lqr": LQR,
    "lqr_nominal": LQRNominal,
    "mpc": MPC,
    "lqr_finite": LQRFinite,
    "lqr_quasi_static": LQRQuasiStatic,
    "smc": SMC,
    "two_impulse": TwoImpulsePolicy,
    "deadband": Deadband,
    "zero": Zero,
    "random": Random,
}
"""Classes made with (scenario, gains), the gains being of the class's `Settings`."""
SOLVER: Final = "clarabel"
"""The library that solves cone programs, of the extra `optimal`."""
PLANNING: Final = ("mpc", "lqr_nominal")
"""Those that need it."""
SLOW: Final = ("mpc",)
"""Those that solve a program at each step: a hundred times as long as the others."""
FLOORS: Final = ("zero", "random")
"""Those that no policy should fall below."""


def make_policy(
    name: str, scenario: str | Path | Scenario, gains: Mapping[str, Any] | str | Path | object | None = None
) -> AccelerationPolicy:
    """A policy for a scenario.

    Args:
        name: one of `POLICIES`.
        scenario: a registered id, a scenario's name, the path of a YAML file, or a Scenario.
        gains: the policy's settings: an object of its `Settings`, a mapping of its keys, or the path of a YAML file
            with a section of the policy's name. By default those in configs/baselines: of the shipped scenario that
            equals this one, else of default.yaml.

    Raises:
        ConfigError: no such policy or scenario, or wrong gains; one line that names file and key.
    """
    kind = policy_class(name)
    if gains is None:
        gains = gains_path(scenario)
    if isinstance(gains, (str, Path)):
        gains = read_gains(name, Path(gains))
    elif not isinstance(gains, kind.Settings):
        gains = build(kind.Settings, gains, f"gains of {name}")
    policy: AccelerationPolicy = kind(load_scenario(scenario), gains)
    return policy


def policy_class(name: str) -> type[Any]:
    """The class of a policy.

    Raises:
        ConfigError: there is none of that name; one line with its nearest neighbour.
    """
    if name not in POLICIES:
        raise ConfigError(f"no policy named {name!r}; {nearest(name, POLICIES)}")
    return POLICIES[name]


def gains_path(scenario: str | Path | Scenario) -> Path:
    """The gain file in configs/baselines for a scenario."""
    folder = config_folder("baselines")
    name = ENV_IDS.get(scenario, scenario) if isinstance(scenario, str) else scenario
    if name not in scenario_names():
        loaded = load_scenario(name)
        name = next((known for known, shipped in _shipped_scenarios().items() if shipped == loaded), "default")
    path = folder / f"{name}.yaml"
    return path if path.is_file() else folder / "default.yaml"


@lru_cache(maxsize=1)
def _shipped_scenarios() -> dict[str, Scenario]:
    """The scenarios that come with the package, by name."""
    return {name: load_scenario(name) for name in scenario_names()}


def read_gains(name: str, path: Path) -> Any:
    """Settings of a policy from a gain file; if it has no section of that name, the policy's defaults.

    Raises:
        ConfigError: the file is missing, or a section or key in it is wrong.
    """
    sections = load_yaml(path)
    if not isinstance(sections, Mapping):
        raise ConfigError(f"{path}: (top level): must be a mapping of policies, got {str(sections)[:80]}")
    for section in sections:
        if section not in POLICIES:
            raise ConfigError(f"{path}: {section}: no policy of that name; {nearest(str(section), POLICIES)}")
    return build(POLICIES[name].Settings, sections.get(name, {}), f"{path}: {name}")
