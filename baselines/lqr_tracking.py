"""The trajectory-following regulator of the thesis's figures."""

from typing import Literal

import numpy as np

from baselines.guidance import Guidance, Guide, desired_path
from baselines.policy import AccelerationPolicy, Observations
from baselines.riccati import continuous_gain, integrate_tracking
from baselines.timeline import longest_phase
from baselines.weights import Weights
from formation_env.dynamics import get_dynamics
from formation_env.dynamics.base import Array, control_matrix
from formation_env.scenario import Scenario
from formation_env.schedule import Leg, leg_reference, legs
from formation_env.settings import settings


@settings
class LQRTrackingSettings:
    """Gains of `lqr_tracking`.

    Attributes:
        guidance: the desired path, see `baselines.guidance`.
        feedforward: `quasi_static`: g as if the desired state stood still (Ma 2009, eq. 4.19), so that the law lags.
            `integrated`: g and P integrated backwards along the path of each phase, the optimum of eq. (4.16).
        hold: weights in hold.
        transfer: weights in transfer.
    """

    guidance: Guide = "least_cost"
    feedforward: Literal["quasi_static", "integrated"] = "quasi_static"
    hold: Weights = Weights(control_s2=(0.5, 0.5, 0.5))
    transfer: Weights = Weights(control_s2=(0.5, 0.5, 0.5))


class LQRTracking(AccelerationPolicy):
    """u = -R^-1 B' P x + R^-1 B' g with C = I (Ma 2009, eq. 4.17-4.19), by the filter's continuous model."""

    Settings = LQRTrackingSettings

    def __init__(self, scenario: Scenario, gains: LQRTrackingSettings) -> None:
        super().__init__(scenario)
        self.gains = gains
        self._guidance = Guidance(scenario, gains.guidance)
        if gains.feedforward == "integrated":
            self._K_of_step, self._pull_of_step = integrated_tables(scenario, gains)
        both = [tracking_gains(scenario, weights) for weights in (gains.hold, gains.transfer)]
        self.K = np.stack([K for K, _ in both])
        self.K_desired = np.stack([K_desired for _, K_desired in both])

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        now = self._guidance.track(observation)
        if self.gains.feedforward == "integrated":
            K, pull = (table[now.phase, now.steps_left] for table in (self._K_of_step, self._pull_of_step))
            return pull - (K @ (now.desired + now.error)[..., None])[..., 0]
        index = 1 - now.in_hold.astype(np.intp)
        # -K x + K_d y_d with x = y_d + e
        surplus = self.K_desired[index] - self.K[index]
        return (surplus @ now.desired[..., None] - self.K[index] @ now.error[..., None])[..., 0]


def tracking_gains(scenario: Scenario, weights: Weights) -> tuple[Array, Array]:
    """Gains (3, 6) of the state and of the desired state that stands still: g = (P B R^-1 B' - A')^-1 C' Q y_d."""
    A, B = continuous_model(scenario)
    Q, R = weights.Q(), weights.R(scenario.orbit)
    K, P = continuous_gain(A, B, Q, R)
    # R^-1 B' (P B R^-1 B' - A')^-1 Q, with R^-1 B' P = K
    g = np.linalg.solve(P @ B @ np.linalg.solve(R, B.T) - A.T, Q)
    K_desired = np.asarray(np.linalg.solve(R, B.T @ g), np.float64)
    return K, K_desired


def continuous_model(scenario: Scenario) -> tuple[Array, Array]:
    """A (6, 6) and B (6, 3) that the filter believes."""
    belief = scenario.belief
    return get_dynamics(belief.dynamics).state_matrix(belief.orbit, belief.spacecraft), control_matrix()


def integrated_tables(scenario: Scenario, gains: LQRTrackingSettings) -> tuple[Array, Array]:
    """Gains R^-1 B' P (phases, steps left, 3, 6) and pulls R^-1 B' g (phases, steps left, 3), m/s^2."""
    shape = (len(scenario.phases), longest_phase(scenario) + 1)
    K, pull = np.zeros((*shape, 3, 6)), np.zeros((*shape, 3))
    for leg in legs(scenario):
        steps_left = leg.end - np.arange(leg.start, leg.end + 1)
        K[leg.index, steps_left], pull[leg.index, steps_left] = _integrate_leg(scenario, leg, gains)
    return K, pull


def _integrate_leg(scenario: Scenario, leg: Leg, gains: LQRTrackingSettings) -> tuple[Array, Array]:
    """Gains (steps + 1, 3, 6) and pulls (steps + 1, 3) of a phase; after it the error is weighed as if it went on."""
    (A, B), steps = continuous_model(scenario), np.arange(leg.start, leg.end + 1)
    times_s: Array = scenario.dt_s * steps.astype(float)
    way = desired_path(scenario, leg, gains.guidance)
    desired = np.vstack([way, leg_reference(scenario, leg, steps[len(way) :])])
    P = continuous_gain(A, B, gains.hold.Q(), gains.hold.R(scenario.orbit))[1]
    g = P @ desired[-1]
    K, pull = np.zeros((len(steps), 3, 6)), np.zeros((len(steps), 3))
    arrival = leg.arrival - leg.start
    for weights, first, last in ((gains.hold, arrival, len(steps) - 1), (gains.transfer, 0, arrival)):
        if first == last:
            continue
        R, part = weights.R(scenario.orbit), slice(first, last + 1)
        P_on, g_on = integrate_tracking(A, B, weights.Q(), R, times_s[part], desired[part], P, g)
        K[first:last] = np.linalg.solve(R, B.T @ P_on[:-1])
        pull[first:last] = np.linalg.solve(R, B.T @ g_on[:-1].T).T
        P, g = P_on[0], g_on[0]
    return K, pull
