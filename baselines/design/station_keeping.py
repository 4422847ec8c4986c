"""Station keeping in a hold: coast until the predicted error leaves a band, then give the most helpful impulse.

Legend: A (7, 7) the error over a step with the reference's own residual, e~ = (e, 1); M (7, 7) the sum of squared
position errors over the steps to come if the follower coasts, e~' M e~.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from baselines.design.phase_tables import Instants, by_steps_left
from formation_env.numerics.arrays import Array
from formation_env.settings import Positive, Real, settings
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference

_DAMPING = 1e-3
"""Weight of an impulse over its squared leverage in a whole window; it keeps the impulses of short windows small."""


@settings(renamed={"look_ahead_periods": "look_ahead_orbits"})
class StationKeepingSettings:
    """A deadband on the predicted error.

    Attributes:
        band_m: root mean square of the position error over the time to come that coasting may lead to, m.
        look_ahead_orbits: the time to come, in orbital periods; it ends with the phase.
        least_reduction: share of that error which an impulse must take away, else it waits for a better place.
    """

    band_m: Positive = 15.0
    look_ahead_orbits: Positive = 0.5
    least_reduction: Annotated[Real, Field(ge=0, lt=1)] = 0.3


class StationKeeping:
    """A memoryless law of holds: from the estimated error to a rare impulse."""

    def __init__(self, scenario: Scenario, settings: StationKeepingSettings) -> None:
        self._settings, self._window = settings, max(1, scenario.steps(settings.look_ahead_orbits))
        self._A = by_steps_left(scenario, lambda leg: error_steps(scenario, leg))
        # the impulse acts over the step, so the sum from the step's end on counts
        self._M = by_steps_left(scenario, lambda leg: coasting_sums(error_steps(scenario, leg), self._window)[1:])
        self._Gamma = by_steps_left(scenario, lambda leg: scenario.filter_dynamics().steps(leg.start, leg.end).Gamma)

    def acceleration(self, error: Array, at: Instants) -> Array:
        """Accelerations (..., 3), m/s^2, not cut to the limit; zero in a coast.

        Args:
            error: estimated error (..., 6) from the reference.
            at: phase (...) and steps left to its end (...).
        """
        M, Gamma = self._M[at], self._Gamma[at]
        coast = _times(self._A[at], np.concatenate([error, np.ones((*error.shape[:-1], 1))], axis=-1))
        pull, before = _times(M, coast), (coast * _times(M, coast)).sum(axis=-1)
        slope = _times(Gamma.swapaxes(-1, -2), pull[..., :6])
        stiffness = Gamma.swapaxes(-1, -2) @ M[..., :6, :6] @ Gamma
        impulse = -np.linalg.solve(stiffness + self._damping(Gamma), slope[..., None])[..., 0]
        gained = -2 * (slope * impulse).sum(axis=-1) - (impulse * _times(stiffness, impulse)).sum(axis=-1)
        left = np.clip(at[1] - 1, 1, self._window)
        fires = (before > left * self._settings.band_m**2) & (
            before - gained < (1 - self._settings.least_reduction) ** 2 * before
        )
        return np.where(fires[..., None], impulse, 0.0)

    def _damping(self, Gamma: Array) -> Array:
        """A share of the greatest stiffness (..., 3, 3): a speed v leads v t away in a time t."""
        speed = Gamma[..., 3:, :]
        step_s = speed[..., :1, :1]
        reach = self._window**3 / 3 * step_s**2
        return _DAMPING * reach * (speed.swapaxes(-1, -2) @ speed)


def _times(matrix: Array, vector: NDArray[np.floating]) -> Array:
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product


def error_steps(scenario: Scenario, leg: Leg) -> Array:
    """A of each step of a phase (steps, 7, 7): (e, 1) -> (Phi e + the reference's deviation from a coast, 1)."""
    model = scenario.filter_dynamics().steps(leg.start, leg.end)
    reference = leg_reference(scenario, leg, np.arange(leg.start, leg.end + 1))
    A = np.zeros((leg.end - leg.start, 7, 7))
    A[:, :6, :6] = model.Phi
    A[:, :6, 6] = _times(model.Phi, reference[:-1]) + model.delta - reference[1:]
    A[:, 6, 6] = 1.0
    return A


def coasting_sums(A: Array, window: int) -> Array:
    """M of each instant (steps + 1, 7, 7): the squared position errors of the `window` instants from it on.

    By doubling: M over 2 w instants is M over w, and M over the w after them carried back. After the last step nothing
    counts.

    Args:
        A: of each step (steps, 7, 7).
        window: instants.
    """
    position = np.diag([1.0, 1, 1, 0, 0, 0, 0])
    now = np.arange(len(A) + 1)
    carry, part = np.concatenate([A, np.eye(7)[None]]), np.tile(position, (len(A) + 1, 1, 1))
    part[-1] = 0.0  # the phase's last instant belongs to the next phase
    total, moved = np.zeros_like(part), np.tile(np.eye(7), (len(A) + 1, 1, 1))
    done, size = 0, 1
    while done < window:
        if (window >> (size.bit_length() - 1)) & 1:
            later = np.minimum(now + done, len(A))
            total = total + moved.swapaxes(-1, -2) @ part[later] @ moved
            moved, done = carry[later] @ moved, done + size
        after = np.minimum(now + size, len(A))
        part, carry = part + carry.swapaxes(-1, -2) @ part[after] @ carry, carry[after] @ carry
        size *= 2
    return total
