"""Gains of every step of a phase from the scenario's own cost, by iteratively reweighted LQG.

The return counts |u| and |e|, not their squares. With weights 1 / rms |u_k| and error weight / rms |e_k| of the round
before, a quadratic cost has the same sum, and its minimum moves towards the least E|u| and E|e| (Daubechies et al.
2010, doi 10.1002/cpa.20303, for sums without expectation). The rms values follow from the nominal start, its spread,
and the noises, as if no measurement were lost.

Legend: Phi, Gamma model; K gain (the filter's in `knowledge`); P covariance of the estimate's error, X of the estimate;
S innovation covariance.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np
from pydantic import Field, Strict

from baselines.design.phase_tables import start_error
from baselines.design.riccati import OVERLOAD, time_varying_regulator
from baselines.design.steady_state_filter import measurement
from formation_env.dynamics.base import DiscreteModel
from formation_env.navigation.filter_settings import process_noise_covariance
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import compiled_loop
from formation_env.settings import Positive, settings
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, legs, score_table

FIRST_ERROR_M: Final = 100.0
"""Position error that the first round expects everywhere."""
ERROR_FLOOR_M: Final = 0.01
"""Added to position errors, so that no weight is infinite."""


@dataclass(frozen=True)
class Knowledge:
    """Covariances of the filter, which do not depend on the controls.

    Attributes:
        missed: covariances of the estimate's error just after each measurement (steps + 1, 6, 6).
        learned: covariances of the estimate's change by each measurement (steps + 1, 6, 6).
    """

    missed: Array
    learned: Array

    def during(self, leg: Leg) -> "Knowledge":
        """The covariances at a phase's instants, its start and its end included."""
        instants = slice(leg.start, leg.end + 1)
        return Knowledge(self.missed[instants], self.learned[instants])


def knowledge(scenario: Scenario, model: DiscreteModel) -> Knowledge:
    """The filter's covariances over an episode in which all measurements arrive (Ma 2009, eq. 4.71-4.75)."""
    filter_model, start = scenario.filter_model, scenario.start
    H, R_noise = measurement(scenario)
    P = np.diag(np.repeat([start.initial_sigma_pos_m, start.initial_sigma_vel_m_s], 3) ** 2)
    model = model.steps(0, scenario.num_steps)
    Q_noise = process_noise_covariance(model.Gamma, filter_model.process_noise_m_s2)
    missed, learned = np.zeros((2, scenario.num_steps + 1, 6, 6))
    for step in range(scenario.num_steps + 1):
        S = H @ P @ H.T + R_noise
        K = P @ H.T @ np.linalg.pinv(S, hermitian=True)
        learned[step] = K @ S @ K.T
        # Joseph's form: P - K S K' is not positive where a sensor without noise leaves nothing
        rest = np.eye(6) - K @ H
        missed[step] = rest @ P @ rest.T + K @ R_noise @ K.T
        if step < scenario.num_steps:
            P = model.Phi[step] @ missed[step] @ model.Phi[step].T + Q_noise[step]
    return Knowledge(missed, learned)


@dataclass(frozen=True)
class Spread:
    """Root mean squares along a phase.

    Attributes:
        control: of the acceleration (steps,), m/s^2.
        error: of the true position error (steps + 1,), m.
        peak: of the acceleration's loudest axis (steps,), m/s^2.
        last: second moment (6, 6) of the estimated error at the end.
    """

    control: Array
    error: Array
    peak: Array
    last: Array


def spread(model: DiscreteModel, gains: Array, start: Array, first: Array, known: Knowledge) -> Spread:
    """Root mean squares of controls and errors under u = -K e_hat.

    Args:
        model: the filter's model of each step (steps, ...).
        gains: (steps, 3, 6).
        start: mean error (6,) at the beginning.
        first: covariance (6, 6) of the estimate about it.
        known: of the instants of the phase.
    """
    second, steps = np.zeros((len(gains) + 1, 6, 6)), len(gains)
    second[0] = np.outer(start, start) + first
    Phi, Gamma = (np.ascontiguousarray(part) for part in (model.Phi, model.Gamma))
    _moments(Phi, Gamma, np.ascontiguousarray(gains), known.learned, second)
    squares = ((gains @ second[:steps]) * gains).sum(axis=2)  # the diagonals of K X K'
    in_position = np.einsum("tii->ti", second + known.missed)[:, :3]
    return Spread(
        control=np.sqrt(squares.sum(axis=1)),
        error=np.sqrt(in_position.sum(axis=1)),
        peak=np.sqrt(squares.max(axis=1)),
        last=second[-1],
    )


@compiled_loop
def _moments(Phi: Array, Gamma: Array, gains: Array, learned: Array, second: Array) -> None:
    """Fill in the estimated error's second moments (steps + 1, 6, 6) from the first on."""
    for step in range(len(gains)):
        closed = Phi[step] - Gamma[step] @ gains[step]
        second[step + 1] = closed @ second[step] @ closed.T + learned[step + 1]


@dataclass(frozen=True)
class PhaseDesign:
    """A phase's regulator.

    Attributes:
        gains: K (steps, 3, 6) of u = -K (x_hat - reference).
        stiffness: (steps, 3, 3), see `riccati.time_varying_regulator`; the cost's unit is m/s.
    """

    gains: Array
    stiffness: Array


@settings(renamed={"price_scale": "error_weight_scale"})
class ReweightedLQGSettings:
    """Settings of the reweighting.

    Attributes:
        rounds: number of reweighting rounds after the first design.
        floor: added to the rms thrust in the reweighting, in units of max_accel_m_s2; it keeps all weights finite.
        error_weight_scale: factor of the scenario's error weight.
    """

    rounds: Annotated[int, Strict(), Field(ge=0, le=100)] = 30
    floor: Positive = 3e-4
    error_weight_scale: Positive = 1.0


DEFAULTS: Final = ReweightedLQGSettings()


def reweighted_gains(scenario: Scenario, settings: ReweightedLQGSettings = DEFAULTS) -> tuple[Array, ...]:
    """Gains (steps, 3, 6) of each phase, see `reweighted_design`."""
    return tuple(design.gains for design in reweighted_design(scenario, settings))


@lru_cache(maxsize=32)
def reweighted_design(scenario: Scenario, settings: ReweightedLQGSettings = DEFAULTS) -> tuple[PhaseDesign, ...]:
    """The regulator of each phase.

    Each phase is scored by itself; its start is the nominal one with the second moment that the phase before ends with.
    """
    known = knowledge(scenario, scenario.filter_dynamics())
    first, result = known.learned[0], []
    for leg in legs(scenario):
        design, first = _design(scenario, leg, first, known.during(leg), settings)
        for part in (design.gains, design.stiffness):
            part.setflags(write=False)
        result.append(design)
    return tuple(result)


def _design(
    scenario: Scenario, leg: Leg, first: Array, known: Knowledge, settings: ReweightedLQGSettings
) -> tuple[PhaseDesign, Array]:
    """The regulator of a phase, and the second moment (6, 6) of the estimated error at its end."""
    limit, position = scenario.spacecraft.max_accel_m_s2, np.diag([1.0, 1, 1, 0, 0, 0])
    start, model = start_error(scenario, leg), scenario.filter_dynamics().steps(leg.start, leg.end)
    weight, cost = settings.error_weight_scale * error_weights(scenario, leg), scenario.reward.cost()
    control_weight, error_weight = np.full(leg.end - leg.start, scenario.dt_s / limit), weight / FIRST_ERROR_M
    for _ in range(settings.rounds + 1):
        Q, R = error_weight[:, None, None] * position, control_weight[:, None, None] * np.eye(3)
        gains, stiffness = time_varying_regulator(model.Phi, model.Gamma, Q, R)
        rms = spread(model, gains, start, first, known)
        overload = 1 + OVERLOAD * np.maximum(rms.peak / limit - 1, 0)
        control_weight = np.sqrt(control_weight * scenario.dt_s * overload / (rms.control + settings.floor * limit))
        error_weight = np.sqrt(error_weight * weight * cost.per_square(rms.error, ERROR_FLOOR_M))
    return PhaseDesign(gains, stiffness), rms.last


def error_weights(scenario: Scenario, leg: Leg) -> Array:
    """Weights (steps + 1,) of the errors that a phase scores, (m/s) per m; 0 at its start, which it does not score."""
    scores = score_table(scenario)
    here = slice(leg.start, leg.end + 1)
    return np.where(scores.leg[here] == leg.index, scores.error_weight[here], 0.0)


def episode_scatter(scenario: Scenario) -> tuple[Array, Array]:
    """Scatter of an episode about its mean under `reweighted_gains`.

    Returns:
        Root mean squares of the true position error (num_steps + 1,), m, and of the acceleration (num_steps,), m/s^2.
    """
    known = knowledge(scenario, scenario.filter_dynamics())
    first, error, control = known.learned[0], np.zeros(scenario.num_steps + 1), np.zeros(scenario.num_steps)
    for leg, gains in zip(legs(scenario), reweighted_gains(scenario), strict=True):
        model = scenario.filter_dynamics().steps(leg.start, leg.end)
        rms = spread(model, gains, np.zeros(6), first, known.during(leg))
        error[leg.start : leg.end + 1], control[leg.start : leg.end], first = rms.error, rms.control, rms.last
    return error, control
