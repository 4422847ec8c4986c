"""The trajectory-following regulator of the thesis's figures."""

from functools import lru_cache
from typing import Literal

import numpy as np

from baselines.controllers.affine_law import AffineLaw, reference_table, shown
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.search_space import REGULATOR
from baselines.controllers.weights import Weights
from baselines.design.guidance import GuidanceName, desired_states
from baselines.design.phase_tables import by_steps_left
from baselines.design.riccati import continuous_gain, integrate_tracking
from formation_env.dynamics import get_dynamics
from formation_env.dynamics.base import control_matrix
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import ConfigError, settings
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, legs


@settings
class LQRQuasiStaticSettings:
    """Settings of `lqr_quasi_static`.

    Attributes:
        guidance: the desired path, see `baselines.design.guidance`.
        feedforward: `quasi_static`: g as if the desired state stood still (Ma 2009, eq. 4.19), so that the law lags.
            `integrated`: g and P integrated backwards along the path of each phase, the optimum of eq. (4.16).
        hold: weights in hold.
        transfer: weights in transfer.
    """

    guidance: GuidanceName = "least_cost"
    feedforward: Literal["quasi_static", "integrated"] = "quasi_static"
    hold: Weights = Weights(control_s2=(0.5, 0.5, 0.5))
    transfer: Weights = Weights(control_s2=(0.5, 0.5, 0.5))


class LQRQuasiStatic(AccelerationPolicy):
    """u = -R^-1 B' P x + R^-1 B' g with C = I (Ma 2009, eq. 4.17-4.19), by the filter's continuous model."""

    name = "lqr_quasi_static"
    Settings = LQRQuasiStaticSettings
    settings: LQRQuasiStaticSettings
    search_space = REGULATOR
    proportional = True
    color, symbol, dash = "#3D9BD1", "square", "dash"

    def __init__(self, scenario: Scenario, settings: LQRQuasiStaticSettings) -> None:
        super().__init__(scenario, settings)
        parts = {leg: leg_gains(scenario, leg, settings) for leg in legs(scenario)}
        self.K = by_steps_left(scenario, lambda leg: parts[leg][0])
        pull = by_steps_left(scenario, lambda leg: parts[leg][1])
        # u = pull - K (y_r + e), with the reference y_r and the error e from it
        self._law = AffineLaw(scenario, self.K, -reference_table(scenario), pull)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        return self._law.acceleration(shown(observation, "error"), self._law.instants(observation))


def leg_gains(scenario: Scenario, leg: Leg, settings: LQRQuasiStaticSettings) -> tuple[Array, Array]:
    """Gains R^-1 B' P (steps, 3, 6) and pulls R^-1 B' g (steps, 3), m/s^2, of a phase from its beginning on."""
    desired = desired_states(scenario, leg, settings.guidance)
    if settings.feedforward == "integrated":
        return _integrate_leg(scenario, leg, settings, desired)
    K, K_desired = (
        np.concatenate([transfer[leg.start : leg.arrival], hold[leg.arrival : leg.end]])
        for transfer, hold in zip(
            tracking_gains(scenario, settings.transfer), tracking_gains(scenario, settings.hold), strict=True
        )
    )
    return K, (K_desired @ desired[:-1, :, None])[..., 0]


@lru_cache(maxsize=8)
def tracking_gains(scenario: Scenario, weights: Weights) -> tuple[Array, Array]:
    """Gains (num_steps, 3, 6) of the state and of the desired state, as if that stood still.

    u = -K x + K_d y_d with K = R^-1 B' P and K_d = R^-1 B' (P B R^-1 B' - A')^-1 Q, by the model of the step's start.
    """
    A, B = continuous_model(scenario)
    Q, R = weights.Q(), weights.R(scenario.orbit)
    frozen = [_quasi_static(now, B, Q, R) for now in (A if A.ndim == 3 else A[None])]
    K, K_desired = (np.broadcast_to(np.array(part), (scenario.num_steps, 3, 6)) for part in zip(*frozen, strict=True))
    return K, K_desired


def _quasi_static(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Gains (3, 6) of the state and of the desired state (Ma 2009, eq. 4.17-4.19)."""
    K, P = continuous_gain(A, B, Q, R)
    # g = (P B R^-1 B' - A')^-1 C' Q y_d
    g = np.linalg.solve(P @ B @ np.linalg.solve(R, B.T) - A.T, Q)
    return K, np.asarray(np.linalg.solve(R, B.T @ g), np.float64)


def continuous_model(scenario: Scenario) -> tuple[Array, Array]:
    """A (6, 6), or (num_steps, 6, 6) if it varies, and B (6, 3) of the filter's model."""
    filter_model = scenario.filter_model
    times_s = scenario.dt_s * np.arange(scenario.num_steps)
    return get_dynamics(filter_model.dynamics).state_matrix(
        filter_model.orbit, filter_model.spacecraft, times_s
    ), control_matrix()


def _integrate_leg(
    scenario: Scenario, leg: Leg, settings: LQRQuasiStaticSettings, desired: Array
) -> tuple[Array, Array]:
    """Gains and pulls of a phase by integration; after it the error is weighed as if it went on."""
    A, B = continuous_model(scenario)
    times_s: Array = scenario.dt_s * np.arange(leg.start, leg.end + 1, dtype=float)
    if A.ndim != 2:
        model = scenario.filter_model.dynamics
        raise ConfigError(f"lqr_quasi_static.feedforward: integrated needs a model that does not vary, got {model}")
    P = continuous_gain(A, B, settings.hold.Q(), settings.hold.R(scenario.orbit))[1]
    g = P @ desired[-1]
    K, pull = np.zeros((leg.end - leg.start, 3, 6)), np.zeros((leg.end - leg.start, 3))
    arrival = leg.arrival - leg.start
    for weights, first, last in ((settings.hold, arrival, len(K)), (settings.transfer, 0, arrival)):
        if first == last:
            continue
        R, part = weights.R(scenario.orbit), slice(first, last + 1)
        P_on, g_on = integrate_tracking(A, B, weights.Q(), R, times_s[part], desired[part], P, g)
        K[first:last] = np.linalg.solve(R, B.T @ P_on[:-1])
        pull[first:last] = np.linalg.solve(R, B.T @ g_on[:-1].T).T
        P, g = P_on[0], g_on[0]
    return K, pull
