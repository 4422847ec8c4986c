"""Linear quadratic regulator of the error state, with weights of their own for transfer and hold."""

from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from baselines.guidance import Guidance, Guide, desired_path, longest_transfer, nominal_start
from baselines.policy import AccelerationPolicy, Observations
from baselines.riccati import least_fuel_gains, stationary_gain
from baselines.weights import Weights
from formation_env.dynamics.base import Array
from formation_env.scenario import Scenario
from formation_env.schedule import Leg, legs
from formation_env.settings import Flag, Positive, settings


@settings
class TransferSettings:
    """How a transfer is flown.

    Attributes:
        horizon: `infinite`: one gain, the weights hold at every step. `finite`: a gain for each number of steps to
            arrival, the state's weights hold at the arrival only (Ma 2009, eq. 4.12-4.14).
        weights: of errors from the desired path, and of control.
        rounds: finite horizon: how often the control's weights are renewed, towards least fuel; 0 is least energy.
        floor: finite horizon: smallest burn that is told from none, in units of max_accel_m_s2.
    """

    horizon: Literal["finite", "infinite"] = "finite"
    weights: Weights = Weights(velocity_s2=(1e6, 1e6, 1e6), control_s2=(1e-3, 1e-3, 1e-3))
    rounds: Annotated[int, Strict(), Field(ge=0, le=100)] = 30
    floor: Positive = 3e-3


@settings
class LQRSettings:
    """Gains of `lqr`.

    Attributes:
        guidance: the desired path of transfers, see `baselines.guidance`.
        feedforward: whether the thrust that the desired path itself takes is added.
        hold: weights in hold.
        transfer: how transfers are flown.
    """

    guidance: Guide = "automatic"
    feedforward: Flag = True
    hold: Weights = Weights(velocity_s2=(1e5, 1e5, 1e5), control_s2=(3e5, 3e5, 3e5))
    transfer: TransferSettings = TransferSettings()


class LQR(AccelerationPolicy):
    """u = -K (x_hat - x_d) + feedforward, by the filter's discrete model (Ma 2009, eq. 4.10)."""

    Settings = LQRSettings

    def __init__(self, scenario: Scenario, gains: LQRSettings) -> None:
        super().__init__(scenario)
        self.gains = gains
        self._guidance = Guidance(scenario, gains.guidance)
        self._to_accel = np.linalg.pinv(scenario.filter_model().Gamma) * gains.feedforward
        self.K = gain_table(scenario, gains)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        now = self._guidance.track(observation)
        K = self.K[now.phase, now.steps_to_arrival]
        feedback = -(K @ now.error[..., None])[..., 0]
        acceleration: Array = feedback + now.residual @ self._to_accel.T
        return acceleration


def gain_table(scenario: Scenario, gains: LQRSettings) -> Array:
    """Gains (phases, steps to arrival, 3, 6); those at the arrival, 0 steps to go, hold from then on."""
    model, hold, transfer = scenario.filter_model(), gains.hold, gains.transfer
    table = np.empty((len(scenario.phases), longest_transfer(scenario) + 1, 3, 6))
    on_the_way = transfer.weights if transfer.horizon == "infinite" else hold
    table[:] = stationary_gain(model.Phi, model.Gamma, on_the_way.Q(), on_the_way.R(scenario.orbit))
    table[:, 0] = stationary_gain(model.Phi, model.Gamma, hold.Q(), hold.R(scenario.orbit))
    if transfer.horizon == "finite":
        for leg in legs(scenario):
            steps = leg.arrival - leg.start
            table[leg.index, steps:0:-1] = transfer_gains(scenario, leg, gains.guidance, transfer)
    return table


@lru_cache(maxsize=64)
def transfer_gains(scenario: Scenario, leg: Leg, guidance: Guide, transfer: TransferSettings) -> Array:
    """Gains (steps, 3, 6) of a leg's transfer, from its start on; the weights are renewed for the nominal start."""
    model = scenario.filter_model()
    start = nominal_start(scenario, leg) - desired_path(scenario, leg, guidance)[0]
    R = np.tile(transfer.weights.R(scenario.orbit), (leg.arrival - leg.start, 1, 1))
    limit = scenario.spacecraft.max_accel_m_s2
    Q, rounds, floor = transfer.weights.Q(), transfer.rounds, transfer.floor
    gains = least_fuel_gains(model.Phi, model.Gamma, R, Q, start, limit, rounds, floor)
    gains.setflags(write=False)
    return gains
