"""Where the follower should be at each instant: the desired path, as an offset from the reference.

In hold the desired path is the reference. During a transfer it may be

- `automatic`: the reference as well, so the controller finds the way (Ma 2009, section 3.2.3);
- `straight_line`: a straight line in LVLH at constant speed (section 3.2.2);
- `least_fuel`: the path of few burns that `riccati.least_fuel_gains` finds for the nominal start.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from baselines.policy import Observations
from baselines.riccati import closed_loop, least_fuel_gains
from formation_env.dynamics import transition_matrix
from formation_env.dynamics.base import Array
from formation_env.scenario import Scenario
from formation_env.schedule import Leg, leg_reference, legs, observation_layout

Guide = Literal["automatic", "straight_line", "least_fuel"]

_ARRIVAL_WEIGHT = 1e9
"""Of the planned path's error at the arrival, against its acceleration in the thesis's units: nearly a constraint."""


@dataclass(frozen=True)
class Tracking:
    """What a controller has to do now, for observations (...).

    Attributes:
        error: estimated minus desired state (..., 6), m and m/s.
        desired: desired state (..., 6).
        residual: what the filter's model lacks to go along the desired path by itself over the next step, (..., 6).
        phase: index of the phase (...).
        steps_to_arrival: (...), 0 in hold.
    """

    error: Array
    desired: Array
    residual: Array
    phase: np.ndarray
    steps_to_arrival: np.ndarray


class Guidance:
    """The desired path of a scenario, looked up by phase and time to arrival."""

    def __init__(self, scenario: Scenario, guide: Guide) -> None:
        model = scenario.filter_model()
        step = transition_matrix(scenario.orbit.mean_motion_rad_s, scenario.dt_s)
        self._scenario = scenario
        self._layout = observation_layout(scenario)
        self._reference_residual = step - model.Phi
        self._delta = model.delta
        self._offsets = _offsets(scenario, guide)
        following = np.roll(self._offsets, 1, axis=1)
        following[:, 0] = 0
        # x_d(k+1) - Phi x_d(k), without the reference's share
        self._residuals = following - self._offsets @ model.Phi.T

    def track(self, observation: Observations) -> Tracking:
        """Compare the estimate with the desired path.

        Args:
            observation: (..., SIZE).
        """
        layout = self._layout
        reference = layout.state(observation, "reference")
        phase = layout.phase(observation)
        steps = np.rint(layout.time_to_arrival_s(observation) / self._scenario.dt_s).astype(np.intp)
        steps = np.clip(steps, 0, self._offsets.shape[1] - 1)
        offset = self._offsets[phase, steps]
        return Tracking(
            error=layout.state(observation, "error") - offset,
            desired=reference + offset,
            residual=reference @ self._reference_residual.T - self._delta + self._residuals[phase, steps],
            phase=phase,
            steps_to_arrival=steps,
        )


def longest_transfer(scenario: Scenario) -> int:
    """Steps of the longest transfer."""
    return max(leg.arrival - leg.start for leg in legs(scenario))


def nominal_start(scenario: Scenario, leg: Leg) -> Array:
    """Where a leg's transfer should begin (6,): at the previous phase's reference, or at the scenario's start."""
    if leg.index == 0:
        return scenario.start.formation.state(scenario.orbit)
    return leg_reference(scenario, legs(scenario)[leg.index - 1], np.array(leg.start))


def _offsets(scenario: Scenario, guide: Guide) -> Array:
    """Desired minus reference state (phases, steps to arrival, 6)."""
    offsets = np.zeros((len(scenario.phases), longest_transfer(scenario) + 1, 6))
    for leg in legs(scenario):
        steps = np.arange(leg.start, leg.arrival)
        if len(steps):
            path = desired_path(scenario, leg, guide)[:-1]
            offsets[leg.index, leg.arrival - steps] = path - leg_reference(scenario, leg, steps)
    return offsets


def desired_path(scenario: Scenario, leg: Leg, guide: Guide) -> Array:
    """Desired states (steps + 1, 6) of a leg's transfer, from its start to its arrival."""
    return PATHS[guide](scenario, leg)


def reference_path(scenario: Scenario, leg: Leg) -> Array:
    """The reference itself, states (steps + 1, 6)."""
    return leg_reference(scenario, leg, np.arange(leg.start, leg.arrival + 1))


def straight_line(scenario: Scenario, leg: Leg) -> Array:
    """The straight line in LVLH of a leg's transfer, at constant speed (Ma 2009, section 3.2.2).

    Returns:
        States (steps + 1, 6) from the transfer's start to its arrival; the velocity is the line's.
    """
    start, goal = nominal_start(scenario, leg)[:3], leg_reference(scenario, leg, np.array(leg.arrival))[:3]
    steps = leg.arrival - leg.start
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    velocity = np.broadcast_to((goal - start) / (steps * scenario.dt_s), (steps + 1, 3))
    return np.hstack([start + share * (goal - start), velocity])


@lru_cache(maxsize=64)
def least_fuel_path(scenario: Scenario, leg: Leg) -> Array:
    """The path of few burns from the nominal start to the arrival by the filter's model, states (steps + 1, 6)."""
    model = scenario.filter_model()
    n = scenario.orbit.mean_motion_rad_s
    reference = reference_path(scenario, leg)
    start = nominal_start(scenario, leg) - reference[0]
    R = np.tile(np.eye(3) / n**4, (leg.arrival - leg.start, 1, 1))
    terminal = _ARRIVAL_WEIGHT * np.diag([1, 1, 1, n**-2, n**-2, n**-2])
    limit = 0.9 * scenario.spacecraft.max_accel_m_s2
    gains = least_fuel_gains(model.Phi, model.Gamma, R, terminal, start, limit, rounds=30, floor=1e-3)
    path = reference + closed_loop(model.Phi, model.Gamma, gains, start)[0]
    path.setflags(write=False)
    return path


PATHS: Final[dict[str, Callable[[Scenario, Leg], Array]]] = {
    "automatic": reference_path,
    "straight_line": straight_line,
    "least_fuel": least_fuel_path,
}
