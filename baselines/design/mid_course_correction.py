"""Mid-course corrections: effect of a thrust on the error at the arrival, and the impulse that cancels a miss.

Legend: Phi (6, 6) from now to the arrival, Phi_rv its block from velocities to positions.
"""

import numpy as np
from numpy.typing import NDArray

from baselines.design.phase_tables import Instants, by_steps_left
from baselines.design.transfers import LEAST_LEVERAGE
from formation_env.numerics.arrays import Array
from formation_env.settings import NonNegative, settings
from formation_env.task.observation import SIGMA_DECADES, SIGMA_UNIT_POS_M, SIGMA_UNIT_VEL_M_S, observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg

_NO_LEVERAGE_S = 1e-9
"""Leverage that stands in for 0, to divide by where the quotient is not used, s."""


@settings
class CorrectionSettings:
    """Thresholds on a transfer's predicted miss for a corrective impulse.

    Attributes:
        miss_m: predicted position error at the arrival below which the follower coasts, m.
        miss_sigmas: the same threshold in units of the filter's sigma of that error.
    """

    miss_m: NonNegative = 10.0
    miss_sigmas: NonNegative = 2.0


class MidCourse:
    """Predictions and corrections of a scenario's transfers, looked up by phase and steps left."""

    def __init__(self, scenario: Scenario, settings: CorrectionSettings) -> None:
        self._settings, self._layout = settings, observation_layout(scenario)
        self._coast = by_steps_left(scenario, lambda leg: to_arrival(scenario, leg))
        self._aim = by_steps_left(scenario, lambda leg: aims(scenario, leg))

    def coast(self, at: Instants) -> Array:
        """Phi (..., 6, 6); zero in hold."""
        coast: Array = self._coast[at]
        return coast

    def impulse(self, miss_m: Array, at: Instants) -> Array:
        """Impulse (..., 3), m/s, that cancels a predicted miss (..., 3), m, as far as it has leverage on it."""
        impulse: Array = -(self._aim[at] @ miss_m[..., None])[..., 0]
        return impulse

    def is_off(self, miss_m: Array, observation: NDArray[np.floating], at: Instants) -> NDArray[np.bool_]:
        """Whether a predicted miss (..., 3), m, stands out from the uncertainty of its prediction."""
        Phi = self._coast[at]
        sigma_pos_m, sigma_vel_m_s = (
            sigmas(self._layout.scalar(observation, "sigma_pos"), SIGMA_UNIT_POS_M),
            sigmas(self._layout.scalar(observation, "sigma_vel"), SIGMA_UNIT_VEL_M_S),
        )
        spread = np.hypot(
            sigma_pos_m * np.linalg.norm(Phi[..., :3, :3], axis=(-2, -1)),
            sigma_vel_m_s * np.linalg.norm(Phi[..., :3, 3:], axis=(-2, -1)),
        )
        bound = np.maximum(self._settings.miss_m, self._settings.miss_sigmas * spread)
        return np.asarray(np.linalg.norm(miss_m, axis=-1) > bound)


def sigmas(shown: Array, unit: float) -> Array:
    """Decode a sigma from its block of the observation."""
    return np.asarray(unit * 10.0 ** (SIGMA_DECADES * shown))


def to_arrival(scenario: Scenario, leg: Leg) -> Array:
    """Phi from each instant of a transfer to its arrival (steps, 6, 6)."""
    Phi = scenario.filter_dynamics().steps(leg.start, leg.arrival).from_start().Phi
    return np.asarray(Phi[-1] @ np.linalg.inv(Phi[:-1]))


def aims(scenario: Scenario, leg: Leg) -> Array:
    """Inverses (steps, 3, 3) of Phi_rv at each instant of a transfer, none along directions of too little leverage."""
    time_s = scenario.dt_s * np.arange(leg.arrival - leg.start, 0, -1.0)
    least_s = LEAST_LEVERAGE * np.minimum(time_s, 1 / scenario.orbit.mean_motion_rad_s)
    U, leverage_s, Vt = np.linalg.svd(to_arrival(scenario, leg)[:, :3, 3:])
    inverse = np.where(leverage_s > least_s[:, None], 1 / np.maximum(leverage_s, _NO_LEVERAGE_S), 0.0)
    return np.asarray(Vt.swapaxes(-1, -2) @ (inverse[..., None] * U.swapaxes(-1, -2)))
