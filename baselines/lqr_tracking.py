"""The trajectory-following regulator of the thesis's figures."""

import numpy as np

from baselines.guidance import Guidance, Guide
from baselines.policy import AccelerationPolicy, Observations
from baselines.riccati import continuous_gain
from baselines.weights import Weights
from formation_env.dynamics import get_dynamics
from formation_env.dynamics.base import Array, control_matrix
from formation_env.scenario import Scenario
from formation_env.settings import settings


@settings
class LQRTrackingSettings:
    """Gains of `lqr_tracking`.

    Attributes:
        guidance: the desired path, see `baselines.guidance`.
        hold: weights in hold.
        transfer: weights in transfer.
    """

    guidance: Guide = "least_cost"
    hold: Weights = Weights(control_s2=(0.5, 0.5, 0.5))
    transfer: Weights = Weights(control_s2=(0.5, 0.5, 0.5))


class LQRTracking(AccelerationPolicy):
    """u = -R^-1 B' P x + R^-1 B' g, g = (P B R^-1 B' - A')^-1 C' Q y_d with C = I (Ma 2009, eq. 4.17-4.19).

    The law takes y_d for constant, so it lags behind a desired state that moves.
    """

    Settings = LQRTrackingSettings

    def __init__(self, scenario: Scenario, gains: LQRTrackingSettings) -> None:
        super().__init__(scenario)
        self._guidance = Guidance(scenario, gains.guidance)
        both = [tracking_gains(scenario, weights) for weights in (gains.hold, gains.transfer)]
        self.K = np.stack([K for K, _ in both])
        self.K_desired = np.stack([K_desired for _, K_desired in both])

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        now = self._guidance.track(observation)
        index = 1 - now.in_hold.astype(np.intp)
        # -K x + K_d y_d with x = y_d + e
        surplus = self.K_desired[index] - self.K[index]
        return (surplus @ now.desired[..., None] - self.K[index] @ now.error[..., None])[..., 0]


def tracking_gains(scenario: Scenario, weights: Weights) -> tuple[Array, Array]:
    """Gains (3, 6) of the state and of the desired state, by the filter's model in continuous time."""
    dynamics = get_dynamics(scenario.filter.dynamics or scenario.dynamics)
    A, B = dynamics.state_matrix(scenario.orbit, scenario.spacecraft), control_matrix()
    Q = weights.Q()
    K, P = continuous_gain(A, B, Q, weights.R(scenario.orbit))
    # R^-1 B' (P B R^-1 B' - A')^-1 Q, with R^-1 B' P = K
    g = np.linalg.solve(P @ B @ np.linalg.solve(weights.R(scenario.orbit), B.T) - A.T, Q)
    K_desired = np.asarray(np.linalg.solve(weights.R(scenario.orbit), B.T @ g), np.float64)
    return K, K_desired
