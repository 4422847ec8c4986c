"""Guidance: the desired path of each phase, as an offset from the reference.

- `automatic`: the reference, even before the arrival, so the controller finds the way (Ma 2009, section 3.2.3);
- `straight_line`: to the arrival on a straight line in LVLH at constant speed (section 3.2.2);
- `two_impulse`: to the arrival on the coasting path between two impulses, `transfers.two_impulse`;
- `hohmann`: the same, but half a period after the start it is on the reference and stays there (section 3.2.1);
- `least_fuel`: to the arrival on the path of few burns that `riccati.least_fuel_gains` finds for the nominal start;
- `least_cost`: through the whole phase on the mean path of `reweighted_lqg`, which may settle after the arrival.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from baselines.design.phase_tables import (
    Instants,
    by_steps_left,
    nominal_start,
    read_instants,
    start_error,
    transfer_reference,
)
from baselines.design.reweighted_lqg import reweighted_gains
from baselines.design.riccati import closed_loop, least_fuel_gains
from baselines.design.transfers import two_impulse
from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import ConfigError
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

GuidanceName = Literal["automatic", "straight_line", "two_impulse", "hohmann", "least_fuel", "least_cost"]

_ARRIVAL_WEIGHT = 1e9
"""Weight of the least-fuel path's arrival error over that of its acceleration, in the thesis's units: nearly exact."""
_PATH_THRUST_SHARE = 0.9
"""Share of the thrust limit that the least-fuel path may take; the rest is left to the feedback about it."""
_PATH_ROUNDS = 30
"""Reweighting rounds of the least-fuel path, as many as the regulators use by default."""
_PATH_FLOOR = 1e-3
"""Added to the burns in the reweighting of the least-fuel path, in units of its limit; smaller ones vanish."""
_SAME_PLANE_M = 1e-3
"""Amplitude of a motion across the plane that rounding may leave, m."""


@dataclass(frozen=True)
class Tracking:
    """Estimated state against the desired path, for observations (...).

    Attributes:
        error: estimated minus desired state (..., 6), m and m/s.
        at: phase (...) and steps left to its end (...), which index the tables of `by_steps_left`.
    """

    error: Array
    at: Instants


class Guidance:
    """The desired path of a scenario, looked up by phase and steps left.

    Attributes:
        desired: states (phases, steps left, 6), m and m/s.
        residuals: desired state after the next step less the filter model's coast there, likewise.
    """

    def __init__(self, scenario: Scenario, guidance: GuidanceName) -> None:
        self._layout, self._dt_s = observation_layout(scenario), scenario.dt_s
        paths = {leg: desired_states(scenario, leg, guidance) for leg in legs(scenario)}
        self.desired = by_steps_left(scenario, lambda leg: paths[leg])
        self.residuals = by_steps_left(scenario, lambda leg: _residual(scenario, leg, paths[leg]))
        self._offsets = self.desired - by_steps_left(scenario, lambda leg: _reference(scenario, leg))

    def track(self, observation: Observations) -> Tracking:
        """Compare the estimate with the desired path.

        Args:
            observation: (..., SIZE).
        """
        phase, steps_left = read_instants(observation, self._layout, self._dt_s)
        at = phase, np.clip(steps_left, 0, self._offsets.shape[1] - 1)
        return Tracking(self._layout.state(observation, "error") - self._offsets[at], at)


def _reference(scenario: Scenario, leg: Leg) -> Array:
    """Reference states (steps + 1, 6) of a phase."""
    return leg_reference(scenario, leg, np.arange(leg.start, leg.end + 1))


def desired_states(scenario: Scenario, leg: Leg, guidance: GuidanceName) -> Array:
    """Desired states (steps + 1, 6) of a phase: the path, and where it ends the reference."""
    path = desired_path(scenario, leg, guidance)
    return np.concatenate([path, _reference(scenario, leg)[len(path) :]])


def _residual(scenario: Scenario, leg: Leg, desired: Array) -> Array:
    """x_d(k+1) - Phi x_d(k) - delta of each step of a phase (steps, 6)."""
    model = scenario.filter_dynamics().steps(leg.start, leg.end)
    return desired[1:] - (model.Phi @ desired[:-1, :, None])[..., 0] - model.delta


def desired_path(scenario: Scenario, leg: Leg, guidance: GuidanceName) -> Array:
    """Desired states of a phase from its beginning on; where they end, the reference takes over."""
    if leg.arrival == leg.start and guidance != "least_cost":
        return transfer_reference(scenario, leg)
    return PATHS[guidance](scenario, leg)


def straight_line(scenario: Scenario, leg: Leg) -> Array:
    """The straight line in LVLH of a transfer, at constant speed (Ma 2009, section 3.2.2).

    Returns:
        States (steps + 1, 6) from the beginning to the arrival, where the reference takes over; the velocity before is
        the line's.
    """
    goal = leg_reference(scenario, leg, np.array(leg.arrival))
    start, end = nominal_start(scenario, leg)[:3], goal[:3]
    steps = leg.arrival - leg.start
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    velocity = np.broadcast_to((end - start) / (steps * scenario.dt_s), (steps + 1, 3))
    line = np.hstack([start + share * (end - start), velocity])
    line[-1] = goal
    return line


def two_impulse_path(scenario: Scenario, leg: Leg) -> Array:
    """The coasting path from the nominal start to the arrival by the filter's model, states (steps + 1, 6).

    The first state has the first impulse in it, the last one the second.

    Raises:
        ConfigError: no two impulses reach the goal in this time.
    """
    return _coast_to(scenario, leg, leg.arrival)


def hohmann_path(scenario: Scenario, leg: Leg) -> Array:
    """The coasting path of half a period to the reference, then the reference to the arrival, states (steps + 1, 6).

    Where the target is due at another place than Hohmann's ellipse ends, a radial part of the impulses makes up for it.

    Raises:
        ConfigError: the transfer is shorter than half a period, or not in one plane.
    """
    key, meeting = f"guidance: hohmann: phases.{leg.index}", leg.start + scenario.steps(0.5)
    if meeting > leg.arrival:
        given = leg.phase.transfer_orbits
        raise ConfigError(f"{key}.transfer_orbits: must be at least 0.5, half a period, got {given:g}")
    off_plane_m = np.hypot(*(start_error(scenario, leg)[[2, 5]] / [1, scenario.orbit.mean_motion_rad_s]))
    if off_plane_m > _SAME_PLANE_M:
        raise ConfigError(f"{key}.formation: must be in the plane of the phase's start, is {off_plane_m:.4g} m off it")
    wait = leg_reference(scenario, leg, np.arange(meeting + 1, leg.arrival + 1))
    return np.vstack([_coast_to(scenario, leg, meeting), wait])


def _coast_to(scenario: Scenario, leg: Leg, meeting: int) -> Array:
    """Two impulses' path from the nominal start to the reference at a step, states (meeting - leg.start + 1, 6)."""
    time_s = scenario.dt_s * (meeting - leg.start)
    model = scenario.filter_dynamics().steps(leg.start, meeting).from_start()
    whole = DiscreteModel(model.Phi[-1], model.Gamma[-1], model.delta[-1])
    start, goal = nominal_start(scenario, leg), leg_reference(scenario, leg, np.array(meeting))
    try:
        impulses = two_impulse(whole, time_s, scenario.orbit.mean_motion_rad_s, start, goal)
    except ValueError as error:
        raise ConfigError(f"guidance: phases.{leg.index}.transfer_orbits: {error}") from None
    path: Array = model.Phi @ (start + np.concatenate([np.zeros(3), impulses.first_m_s])) + model.delta
    path[-1] = goal
    return path


@lru_cache(maxsize=64)
def least_fuel_path(scenario: Scenario, leg: Leg) -> Array:
    """The path of few burns from the nominal start to the arrival by the filter's model, states (steps + 1, 6)."""
    model = scenario.filter_dynamics().steps(leg.start, leg.arrival)
    n = scenario.orbit.mean_motion_rad_s
    start = start_error(scenario, leg)
    R = np.tile(np.eye(3) / n**4, (leg.arrival - leg.start, 1, 1))
    terminal = _ARRIVAL_WEIGHT * np.diag([1, 1, 1, n**-2, n**-2, n**-2])
    limit = _PATH_THRUST_SHARE * scenario.spacecraft.max_accel_m_s2
    gains = least_fuel_gains(model.Phi, model.Gamma, R, terminal, start, limit, _PATH_ROUNDS, _PATH_FLOOR)
    path = transfer_reference(scenario, leg) + closed_loop(model.Phi, model.Gamma, gains, start)[0]
    path[-1] = leg_reference(scenario, leg, np.array(leg.arrival))
    path.setflags(write=False)
    return path


def least_cost_path(scenario: Scenario, leg: Leg) -> Array:
    """The mean path of the regulator of least expected cost, states (steps + 1, 6) over the whole phase."""
    model = scenario.filter_dynamics().steps(leg.start, leg.end)
    gains = reweighted_gains(scenario)[leg.index]
    reference = leg_reference(scenario, leg, np.arange(leg.start, leg.end + 1))
    return reference + closed_loop(model.Phi, model.Gamma, gains, start_error(scenario, leg))[0]


PATHS: Final[dict[str, Callable[[Scenario, Leg], Array]]] = {
    "automatic": transfer_reference,
    "straight_line": straight_line,
    "two_impulse": two_impulse_path,
    "hohmann": hohmann_path,
    "least_fuel": least_fuel_path,
    "least_cost": least_cost_path,
}
