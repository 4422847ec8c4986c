"""What is searched: gains and limits. To make a policy tunable: a line in `KNOBS`, and its gains in default.yaml."""

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
class Knob:
    """Gains that are turned together.

    Attributes:
        keys: dotted paths of the gains; a number is an axis. The first one is the knob's name.
        low: least value, in the gain's unit.
        high: greatest value.
        log: whether its decades are searched evenly, else its values.
        transfer: whether it matters to transfers only.
    """

    keys: tuple[str, ...]
    low: float
    high: float
    log: bool = True
    transfer: bool = False

    @property
    def name(self) -> str:
        """What a study calls it."""
        return self.keys[0]


def _regulator(section: str, transfer: bool) -> tuple[Knob, ...]:
    """Weights of a regulator: along-track and cross-track position weights stay 1, since only ratios matter."""
    return (
        Knob((f"{section}.position.0",), 1e-2, 1e2, transfer=transfer),
        Knob((f"{section}.velocity_s2.0", f"{section}.velocity_s2.1"), 1e2, 1e8, transfer=transfer),
        Knob((f"{section}.velocity_s2.2",), 1e2, 1e8, transfer=transfer),
        Knob((f"{section}.control_s2.0", f"{section}.control_s2.1"), 1, 1e8, transfer=transfer),
        Knob((f"{section}.control_s2.2",), 1, 1e8, transfer=transfer),
    )


_CORRECTION: Final = (
    Knob(("correction.miss_m",), 0.3, 300, transfer=True),
    Knob(("correction.miss_sigmas",), 0.2, 10, transfer=True),
)
_KEEPING: Final = (
    Knob(("keeping.band_m",), 0.5, 200),
    Knob(("keeping.look_ahead_orbits",), 0.05, 2),
    Knob(("keeping.least_reduction",), 0, 0.95, log=False),
)

KNOBS: Final[dict[str, tuple[Knob, ...]]] = {
    "lqr": (
        Knob(("reweighted_lqg.floor",), 1e-5, 1e-2),
        Knob(("reweighted_lqg.error_weight_scale",), 0.3, 3),
        Knob(("deadband",), 0, 1, log=False),
    ),
    "lqr_nominal": (Knob(("reweighted_lqg.floor",), 1e-5, 1e-2), Knob(("reweighted_lqg.error_weight_scale",), 0.3, 3)),
    "lqr_finite": (*_regulator("transfer", transfer=True), *_regulator("hold", transfer=False)),
    "lqr_quasi_static": (*_regulator("transfer", transfer=True), *_regulator("hold", transfer=False)),
    "smc": (
        *(Knob((f"surface.decay_per_s.{axis}",), 3e-5, 3e-2) for axis in range(3)),
        Knob(("reaching.eps_m_s",), 1e-4, 1),
        Knob(("reaching.q_per_s",), 3e-5, 3e-2),
        Knob(("boundary_m",), 0.1, 1e4),
    ),
    "two_impulse": (*_CORRECTION, Knob(("braking",), 0, 1.5, log=False, transfer=True), *_KEEPING),
    "deadband": (Knob(("least_thrust",), 1e-3, 0.5, transfer=True), *_CORRECTION, *_KEEPING),
    "mpc": (
        Knob(("error_weight_scale",), 0.3, 3),
        Knob(("error_scatter",), 0, 3, log=False),
        Knob(("thrust_scatter",), 0, 2, log=False),
    ),
}
"""Policy -> its knobs; the slowest comes last."""


def knobs_for(policy: str, scenario: Scenario) -> tuple[Knob, ...]:
    """The knobs of a policy that matter to a scenario."""
    transfers = any(scenario.steps(phase.transfer_orbits) for phase in scenario.phases)
    return tuple(knob for knob in KNOBS[policy] if transfers or not knob.transfer)


def first_gains(policy: str) -> dict[str, Any]:
    """What a search begins with: the policy's section of default.yaml, which has every knob."""
    path = config_folder("baselines") / "default.yaml"
    read_gains(policy, path)  # refuses what is wrong in it
    section: dict[str, Any] = load_yaml(path)[policy]
    return section


def present_gains(policy: str, path: Path, knobs: Sequence[Knob]) -> dict[str, float] | None:
    """Where the knobs stand in a gain file, cut to their limits; None if it does not say.

    Raises:
        ConfigError: the file is faulty.
    """
    if not path.is_file():
        return None
    read_gains(policy, path)
    try:
        values = read(load_yaml(path).get(policy, {}), knobs)
    except (KeyError, IndexError, TypeError):
        return None
    return {knob.name: min(max(values[knob.name], knob.low), knob.high) for knob in knobs}


def turn(gains: dict[str, Any], knobs: Sequence[Knob], values: Mapping[str, float]) -> dict[str, Any]:
    """Gains with the knobs at values, by the knobs' names, to three digits."""
    turned = copy.deepcopy(gains)
    for knob in knobs:
        for key in knob.keys:
            target, last = _place(turned, key)
            target[last] = float(f"{values[knob.name]:.3g}")
    return turned


def read(gains: dict[str, Any], knobs: Sequence[Knob]) -> dict[str, float]:
    """Where the knobs stand, by name."""
    places = {knob.name: _place(gains, knob.name) for knob in knobs}
    return {name: float(target[last]) for name, (target, last) in places.items()}


def _place(gains: Any, key: str) -> tuple[Any, str | int]:
    """The mapping or list that holds a gain, and the gain's key or index in it."""
    *parents, last = [int(part) if part.isdigit() else part for part in key.split(".")]
    for part in parents:
        gains = gains[part]
    return gains, last
