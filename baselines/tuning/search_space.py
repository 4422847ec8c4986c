"""Search spaces of the policies' settings; a tunable policy has one here, and a section in default.yaml."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from baselines.controllers.registry import read_gains
from formation_env.settings import load_yaml
from formation_env.task.loading import config_folder
from formation_env.task.scenario import Scenario


@dataclass(frozen=True)
class SearchDimension:
    """One dimension of a search space: settings that share a value.

    Attributes:
        keys: dotted paths of the settings; a number is an axis. The first one names the dimension.
        low: lower limit, in the setting's unit.
        high: upper limit.
        log: whether the logarithm is sampled evenly, else the value.
        transfer: whether the dimension affects transfers only.
    """

    keys: tuple[str, ...]
    low: float
    high: float
    log: bool = True
    transfer: bool = False

    @property
    def name(self) -> str:
        """Name of the parameter in a study."""
        return self.keys[0]


def _regulator(section: str, transfer: bool) -> tuple[SearchDimension, ...]:
    """Weights of a regulator: along-track and cross-track position weights stay 1, since only ratios matter."""
    return (
        SearchDimension((f"{section}.position.0",), 1e-2, 1e2, transfer=transfer),
        SearchDimension((f"{section}.velocity_s2.0", f"{section}.velocity_s2.1"), 1e2, 1e8, transfer=transfer),
        SearchDimension((f"{section}.velocity_s2.2",), 1e2, 1e8, transfer=transfer),
        SearchDimension((f"{section}.control_s2.0", f"{section}.control_s2.1"), 1, 1e8, transfer=transfer),
        SearchDimension((f"{section}.control_s2.2",), 1, 1e8, transfer=transfer),
    )


_CORRECTION: Final = (
    SearchDimension(("correction.miss_m",), 0.3, 300, transfer=True),
    SearchDimension(("correction.miss_sigmas",), 0.2, 10, transfer=True),
)
_KEEPING: Final = (
    SearchDimension(("keeping.band_m",), 0.5, 200),
    SearchDimension(("keeping.look_ahead_orbits",), 0.05, 2),
    SearchDimension(("keeping.least_reduction",), 0, 0.95, log=False),
)

SEARCH_SPACES: Final[dict[str, tuple[SearchDimension, ...]]] = {
    "lqr": (
        SearchDimension(("reweighted_lqg.floor",), 1e-5, 1e-2),
        SearchDimension(("reweighted_lqg.error_weight_scale",), 0.3, 3),
        SearchDimension(("deadband",), 0, 1, log=False),
    ),
    "lqr_nominal": (
        SearchDimension(("reweighted_lqg.floor",), 1e-5, 1e-2),
        SearchDimension(("reweighted_lqg.error_weight_scale",), 0.3, 3),
    ),
    "lqr_finite": (*_regulator("transfer", transfer=True), *_regulator("hold", transfer=False)),
    "lqr_quasi_static": (*_regulator("transfer", transfer=True), *_regulator("hold", transfer=False)),
    "smc": (
        *(SearchDimension((f"surface.decay_per_s.{axis}",), 3e-5, 3e-2) for axis in range(3)),
        SearchDimension(("reaching.eps_m_s",), 1e-4, 1),
        SearchDimension(("reaching.q_per_s",), 3e-5, 3e-2),
        SearchDimension(("boundary_m",), 0.1, 1e4),
    ),
    "two_impulse": (*_CORRECTION, SearchDimension(("braking",), 0, 1.5, log=False, transfer=True), *_KEEPING),
    "deadband": (SearchDimension(("least_thrust",), 1e-3, 0.5, transfer=True), *_CORRECTION, *_KEEPING),
    "mpc": (
        SearchDimension(("error_weight_scale",), 0.3, 3),
        SearchDimension(("error_scatter",), 0, 3, log=False),
        SearchDimension(("thrust_scatter",), 0, 2, log=False),
    ),
}
"""Policy -> its search space; the slowest comes last."""


def search_space(policy: str, scenario: Scenario) -> tuple[SearchDimension, ...]:
    """The dimensions of a policy's search space that affect a scenario."""
    transfers = any(scenario.steps(phase.transfer_orbits) for phase in scenario.phases)
    return tuple(dimension for dimension in SEARCH_SPACES[policy] if transfers or not dimension.transfer)


def default_settings(policy: str) -> dict[str, Any]:
    """The policy's section of default.yaml, where a search starts; it has every dimension's keys."""
    path = config_folder("baselines") / "default.yaml"
    read_gains(policy, path)  # refuses what is wrong in it
    section: dict[str, Any] = load_yaml(path)[policy]
    return section


def values_in_use(policy: str, path: Path, dimensions: Sequence[SearchDimension]) -> dict[str, float] | None:
    """Values of the dimensions in a settings file, clipped to their limits; None if the file does not give them all.

    Raises:
        ConfigError: the file is faulty.
    """
    if not path.is_file():
        return None
    read_gains(policy, path)
    try:
        values = current_values(load_yaml(path).get(policy, {}), dimensions)
    except (KeyError, IndexError, TypeError):
        return None
    return {each.name: min(max(values[each.name], each.low), each.high) for each in dimensions}


def apply(
    settings: dict[str, Any], dimensions: Sequence[SearchDimension], values: Mapping[str, float]
) -> dict[str, Any]:
    """Settings with the dimensions at values, by the dimensions' names, rounded to three digits."""
    changed = copy.deepcopy(settings)
    for dimension in dimensions:
        for key in dimension.keys:
            parent, last = _parent(changed, key)
            parent[last] = float(f"{values[dimension.name]:.3g}")
    return changed


def current_values(settings: dict[str, Any], dimensions: Sequence[SearchDimension]) -> dict[str, float]:
    """Values of the dimensions in settings, by name."""
    places = {dimension.name: _parent(settings, dimension.name) for dimension in dimensions}
    return {name: float(parent[last]) for name, (parent, last) in places.items()}


def _parent(settings: Any, key: str) -> tuple[Any, Any]:
    """The mapping or list that holds a setting, and the setting's key or index in it."""
    *parents, last = [int(part) if part.isdigit() else part for part in key.split(".")]
    for part in parents:
        settings = settings[part]
    return settings, last
