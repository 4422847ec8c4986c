"""Control problems of a receding horizon: a scenario's own cost from any instant on, by the filter's model."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from baselines.design.reweighted_lqg import episode_scatter
from baselines.optimal.cone_program import ConeProgram, ControlProblem, Units
from baselines.optimal.horizon_blocks import block_ends, horizon_end, shared_error_weights
from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array
from formation_env.settings import NonNegative, Positive, settings
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, columns, legs, score_table

_LENGTH_M: Final = 100.0
"""Unit of lengths in the program: the errors that a plan corrects."""
_TOLERANCE: Final = 1e-6
"""Relative tolerance of a plan; the next one replaces it a step later, so the bound's 1e-9 would be wasted."""


@settings(
    renamed={
        "horizon_periods": "horizon_orbits",
        "finest_periods": "finest_orbits",
        "coarsest_periods": "coarsest_orbits",
        "price_scale": "error_weight_scale",
        "arrival_price": "arrival_weight",
    }
)
class MPCSettings:
    """Settings of `mpc`.

    Attributes:
        horizon_orbits: hold time that a plan looks ahead, in orbital periods; transfers on the way come on top.
        finest_orbits: length of a plan's first blocks of constant thrust, in orbital periods; at least a step.
        coarsest_orbits: length of its last blocks; if shorter than the first, all are as long as the first.
        growth: length of a block over its time from now, between the two.
        error_weight_scale: factor of the scenario's error weight.
        error_scatter: factor of the expected scatter of errors about the plan.
        thrust_scatter: factor of the expected scatter of the thrust.
        arrival_weight: extra weight of the position error at the arrivals, (m/s) per m. From some weight on, 1 in the
            shipped scenarios, the arrival is a constraint: exact, where the thrust suffices, else as near as it gets.
    """

    horizon_orbits: Positive = 1.0
    finest_orbits: Positive = 0.005
    coarsest_orbits: Positive = 0.025
    growth: NonNegative = 0.15
    error_weight_scale: Positive = 1.0
    error_scatter: NonNegative = 1.0
    thrust_scatter: NonNegative = 0.5
    arrival_weight: NonNegative = 0.0


class RecedingHorizon:
    """Makes the control problem of each instant of a scenario."""

    def __init__(self, scenario: Scenario, settings: MPCSettings) -> None:
        self._scenario, self._settings = scenario, settings
        self._legs, scores = legs(scenario), score_table(scenario)
        self._model, self._spans = scenario.filter_dynamics(), dict[tuple[int, int], DiscreteModel]()
        self._place = columns(build_schedule(scenario), "scored_position")
        self._scoring_leg = scores.leg
        self._error_weight = settings.error_weight_scale * scores.error_weight
        self._error_weight[[leg.arrival for leg in self._legs if leg.arrival > leg.start]] += settings.arrival_weight
        self._error_scatter, self._thrust_scatter = self._scatter()

    def program(self, instant: int) -> ConeProgram:
        """The cone program of a plan from an instant on, in steps.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        problem = self.problem(instant)
        units = Units(
            length_m=_LENGTH_M,
            speed_m_s=_LENGTH_M * self._scenario.orbit.mean_motion_rad_s,
            accel_m_s2=self._scenario.spacecraft.max_accel_m_s2,
            time_s=float(problem.duration_s.mean()),
        )
        return ConeProgram(problem, units, tolerance=_TOLERANCE)

    def problem(self, instant: int) -> ControlProblem:
        """The control problem from an instant on, in steps."""
        scenario, nodes = self._scenario, self._nodes(instant)
        spans = [self._span(start, end) for start, end in zip(nodes[:-1].tolist(), nodes[1:].tolist(), strict=True)]
        return ControlProblem(
            F=np.array([span.Phi for span in spans]),
            G=np.array([span.Gamma for span in spans]),
            d=np.array([span.delta for span in spans]),
            duration_s=np.diff(nodes) * scenario.dt_s,
            limit_m_s2=np.full(len(spans), scenario.spacecraft.max_accel_m_s2),
            place_m=self._place[nodes[1:]],
            error_weight=shared_error_weights(self._error_weight, self._scoring_leg, nodes),
            cost=scenario.reward.cost(),
            error_scatter_m=self._error_scatter[nodes[1:]],
            thrust_scatter_m_s2=self._thrust_ahead(nodes),
        )

    def _nodes(self, instant: int) -> NDArray[np.intp]:
        """Ends (N + 1,) of the blocks from an instant on."""
        settings, scenario = self._settings, self._scenario
        last = horizon_end(self._legs, instant, max(1, scenario.steps(settings.horizon_orbits)))
        finest = max(1, scenario.steps(settings.finest_orbits))
        coarsest = max(finest, scenario.steps(settings.coarsest_orbits))
        growth = settings.growth
        return block_ends(self._legs, instant, last, finest=finest, coarsest=coarsest, growth=growth)

    def _scatter(self) -> tuple[Array, Array]:
        """Scatter of the position (num_steps + 1,), m, and of the thrust (num_steps,), m/s^2, with their factors."""
        settings, steps = self._settings, self._scenario.num_steps
        if settings.error_scatter == settings.thrust_scatter == 0:
            return np.zeros(steps + 1), np.zeros(steps)
        error, thrust = episode_scatter(self._scenario)
        return settings.error_scatter * error, settings.thrust_scatter * thrust

    def _thrust_ahead(self, nodes: NDArray[np.intp]) -> Array:
        """Mean scatter of the thrust in each block (N,), m/s^2; none in the first, whose thrust is decided now."""
        ahead = np.add.reduceat(self._thrust_scatter[: nodes[-1]], nodes[:-1]) / np.diff(nodes)
        ahead[0] = 0.0
        return np.asarray(ahead)

    def _span(self, start: int, end: int) -> DiscreteModel:
        """The filter's model from one instant to another under constant thrust."""
        key = (0, end - start) if self._model.Phi.ndim == 2 else (start, end)
        if key not in self._spans:
            model = self._model.steps(*key).from_start()
            self._spans[key] = DiscreteModel(model.Phi[-1], model.Gamma[-1], model.delta[-1])
        return self._spans[key]
