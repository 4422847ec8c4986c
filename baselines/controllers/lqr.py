"""Linear quadratic regulator of the error state."""

from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from baselines.controllers.affine_law import AffineLaw, reference_table, shown
from baselines.controllers.lookup import look_up_times
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.search_space import REWEIGHTED_LQG, Parameter
from baselines.controllers.weights import Weights
from baselines.design.guidance import Guidance, GuidanceName, desired_path
from baselines.design.phase_tables import Instants, by_steps_left, nominal_start
from baselines.design.reweighted_lqg import PhaseDesign, ReweightedLQGSettings, reweighted_design
from baselines.design.riccati import finite_horizon_gains, least_fuel_gains, stationary
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import Flag, NonNegative, Positive, settings
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg


@settings
class TransferSettings:
    """Settings of the transfers.

    Attributes:
        horizon: `infinite`: one gain, the weights hold at every step. `finite`: a gain for each number of steps to
            arrival, the state's weights hold at the arrival only (Ma 2009, eq. 4.12-4.14).
        weights: of errors from the desired path, and of control.
        rounds: finite horizon: reweighting rounds of the control's weights, towards least fuel; 0 is least energy.
        floor: finite horizon: added to the burns in the reweighting, in units of max_accel_m_s2; smaller ones vanish.
    """

    horizon: Literal["finite", "infinite"] = "finite"
    weights: Weights = Weights(velocity_s2=(1e6, 1e6, 1e6), control_s2=(1e-3, 1e-3, 1e-3))
    rounds: Annotated[int, Strict(), Field(ge=0, le=100)] = 30
    floor: Positive = 3e-3


@settings(renamed={"expected_cost": "reweighted_lqg"})
class LQRSettings:
    """Settings of `lqr`.

    Attributes:
        design: `reweighted_lqg`: a gain for each step, from the scenario's own cost; `weights`: from `hold` and
            `transfer`.
        guidance: the desired path, see `baselines.design.guidance`; `reweighted_lqg` finds the way by itself.
        feedforward: whether the thrust that the desired path itself takes is added.
        deadband: design `reweighted_lqg`: the follower coasts while a thrust would take off less than this times itself
            from the cost to come; 0 is none, 1 is what thrust costs.
        reweighted_lqg: for that design.
        hold: weights in hold.
        transfer: how transfers are flown.
    """

    design: Literal["reweighted_lqg", "weights"] = "reweighted_lqg"
    guidance: GuidanceName = "automatic"
    feedforward: Flag = True
    deadband: NonNegative = 0.0
    reweighted_lqg: ReweightedLQGSettings = ReweightedLQGSettings()
    hold: Weights = Weights(velocity_s2=(1e5, 1e5, 1e5), control_s2=(3e5, 3e5, 3e5))
    transfer: TransferSettings = TransferSettings()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.design == "reweighted_lqg" and self.guidance != "automatic":
            raise ValueError(f"guidance: must be automatic with design reweighted_lqg, got {self.guidance!r}")
        if self.design == "weights" and self.deadband > 0:
            raise ValueError(f"deadband: must be 0 with design weights, whose cost has no unit, got {self.deadband:g}")
        return self


class LQR(AccelerationPolicy):
    """u = -K (x_hat - x_d) + feedforward, by the filter's discrete model (Ma 2009, eq. 4.10)."""

    name = "lqr"
    Settings: ClassVar[type[Any]] = LQRSettings
    settings: LQRSettings
    search_space: ClassVar[tuple[Parameter, ...]] = (*REWEIGHTED_LQG, Parameter(("deadband",), 0, 1, log=False))
    proportional = True
    color = "#0072B2"

    def __init__(self, scenario: Scenario, settings: LQRSettings) -> None:
        super().__init__(scenario, settings)
        guidance = Guidance(scenario, settings.guidance)
        model = scenario.filter_dynamics()
        if settings.deadband > 0:
            self._stiffness = by_steps_left(scenario, lambda leg: _design(scenario, settings)[leg.index].stiffness)
        self.K = by_steps_left(scenario, lambda leg: phase_gains(scenario, leg, settings))
        to_accel = by_steps_left(scenario, lambda leg: np.linalg.pinv(model.steps(leg.start, leg.end).Gamma))
        own_thrust = settings.feedforward * (to_accel @ guidance.residuals[..., None])[..., 0]
        self._law = AffineLaw(scenario, self.K, guidance.desired - reference_table(scenario), own_thrust)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        at = self._law.instants(observation)
        acceleration = self._law.acceleration(shown(observation, "error"), at)
        if self.settings.deadband == 0:
            return acceleration
        return np.where(self._pays(acceleration, at)[..., None], acceleration, 0.0)

    def _pays(self, acceleration: Array, at: Instants) -> NDArray[np.bool_]:
        """Whether an acceleration (..., 3) reduces the cost to come, per delta-v, by more than the deadband."""
        slope = look_up_times(self._stiffness, at, acceleration)
        return np.asarray(np.vecdot(slope, slope) > (self.settings.deadband * self.scenario.dt_s) ** 2)


def phase_gains(scenario: Scenario, leg: Leg, settings: LQRSettings) -> Array:
    """Gains (steps, 3, 6) of a phase, from its beginning on."""
    if settings.design == "reweighted_lqg":
        return _design(scenario, settings)[leg.index].gains
    hold = _regulator(scenario, settings.hold)[leg.arrival : leg.end]
    if settings.transfer.horizon == "infinite":
        transfer = _regulator(scenario, settings.transfer.weights)[leg.start : leg.arrival]
    else:
        transfer = transfer_gains(scenario, leg, settings.guidance, settings.transfer)
    return np.concatenate([transfer, hold])


def _design(scenario: Scenario, settings: LQRSettings) -> tuple[PhaseDesign, ...]:
    """The regulators of least expected cost."""
    return reweighted_design(scenario, settings.reweighted_lqg)


@lru_cache(maxsize=8)
def _regulator(scenario: Scenario, weights: Weights) -> Array:
    """Gains (steps, 3, 6) of a regulator without end: one gain, or if the model varies, one for each step."""
    model, Q, R = scenario.filter_dynamics(), weights.Q(), weights.R(scenario.orbit)
    steps = scenario.num_steps
    if model.Phi.ndim == 2:
        return np.broadcast_to(stationary(model.Phi, model.Gamma, Q, R)[0], (steps, 3, 6))
    _, P = stationary(model.Phi[-1], model.Gamma[-1], Q, R)
    return finite_horizon_gains(model.Phi, model.Gamma, Q, np.broadcast_to(R, (steps, 3, 3)), P)


@lru_cache(maxsize=64)
def transfer_gains(scenario: Scenario, leg: Leg, guidance: GuidanceName, transfer: TransferSettings) -> Array:
    """Gains (steps, 3, 6) of a leg's transfer, from its start on; the weights are renewed for the nominal start."""
    model = scenario.filter_dynamics().steps(leg.start, leg.arrival)
    start = nominal_start(scenario, leg) - desired_path(scenario, leg, guidance)[0]
    R = np.tile(transfer.weights.R(scenario.orbit), (leg.arrival - leg.start, 1, 1))
    limit = scenario.spacecraft.max_accel_m_s2
    Q, rounds, floor = transfer.weights.Q(), transfer.rounds, transfer.floor
    gains = least_fuel_gains(model.Phi, model.Gamma, R, Q, start, limit, rounds, floor)
    gains.setflags(write=False)
    return gains
