"""Model predictive control: at each step the plan of least cost from the estimate on; its first thrust is given.

A plan looks ahead through the schedule, across arrivals and changes of phase, to a given hold time from now; as the end
of the episode comes near, its horizon shrinks. It knows that errors and thrust will scatter about it: by how much
`baselines.design.reweighted_lqg` says. Without that, each new estimate's noise would be answered by a thrust.
"""

import numpy as np
from numpy.typing import NDArray

from baselines.controllers.policy import AccelerationPolicy
from baselines.design.phase_tables import read_instants
from baselines.design.reweighted_lqg import episode_scatter
from baselines.optimal.horizon_blocks import block_ends, horizon_end, shared_prices
from baselines.optimal.receding_horizon import ConeProgram, Horizon, Plan
from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, Positive, settings
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, column, columns, legs

_UNIT_M = 100.0
"""Unit of lengths inside the cone program."""


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
        error_weight_scale: factor of the scenario's price of errors.
        error_scatter: factor of how far errors are expected to scatter about the plan.
        thrust_scatter: the same for the thrust.
        arrival_weight: extra price of the position error at the arrivals, (m/s) per m. From some price on, 1 in the
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


class MPC(AccelerationPolicy):
    """The first thrust of the plan of least cost by the filter's model, a second-order cone program.

    It has no memory: all rows at the same instant share one program, and differ by its right-hand side.
    """

    Settings = MPCSettings

    def __init__(self, scenario: Scenario, gains: MPCSettings) -> None:
        super().__init__(scenario)
        self.gains = gains
        self._legs, self._layout = legs(scenario), observation_layout(scenario)
        self._model, self._spans = scenario.filter_dynamics(), dict[tuple[int, int], DiscreteModel]()
        table = build_schedule(scenario)
        self._place = columns(table, "scored_position")
        self._price = gains.error_weight_scale * column(table, "error_weight")
        self._price[[leg.arrival for leg in self._legs if leg.arrival > leg.start]] += gains.arrival_weight
        # the phase that judges each instant: a phase's beginning belongs to the one before
        self._judge = np.searchsorted([leg.end for leg in self._legs], np.arange(scenario.num_steps + 1))
        self._error_scatter, self._thrust_scatter = self._scatter()

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        rows = observation.reshape(-1, observation.shape[-1])
        estimates, instants = self._layout.estimate(rows), self._instants(rows)
        result = np.zeros((len(rows), 3))
        for instant in np.unique(instants[instants < self.scenario.num_steps]):
            program = self.program(instant)
            for row in np.flatnonzero(instants == instant):
                result[row] = _first(program.solve(estimates[row]))
        return result.reshape(*observation.shape[:-1], 3)

    def program(self, instant: int) -> ConeProgram:
        """The program of a plan from an instant on, in steps."""
        gains, scenario, reward = self.gains, self.scenario, self.scenario.reward
        last = horizon_end(self._legs, instant, max(1, scenario.steps(gains.horizon_orbits)))
        finest = max(1, scenario.steps(gains.finest_orbits))
        coarsest = max(finest, scenario.steps(gains.coarsest_orbits))
        nodes = block_ends(self._legs, instant, last, finest, coarsest, gains.growth)
        spans = [self._span(start, end) for start, end in zip(nodes[:-1].tolist(), nodes[1:].tolist(), strict=True)]
        horizon = Horizon(
            F=np.array([span.Phi for span in spans]),
            G=np.array([span.Gamma for span in spans]),
            d=np.array([span.delta for span in spans]),
            duration_s=np.diff(nodes) * scenario.dt_s,
            place_m=self._place[nodes[1:]],
            price=shared_prices(self._price, self._judge, nodes),
            error_scatter_m=self._error_scatter[nodes[1:]],
            thrust_scatter_m_s2=self._thrust_ahead(nodes),
            limit_m_s2=self._max_accel_m_s2,
            steepness_per_m=1 / reward.quadratic_scale_m if reward.error_cost == "quadratic" else None,
        )
        return ConeProgram(horizon, _UNIT_M, _UNIT_M * scenario.orbit.mean_motion_rad_s)

    def _instants(self, rows: Observations) -> NDArray[np.intp]:
        """The instants of rows of observations, in steps."""
        phase, steps_left = read_instants(rows, self._layout, self.scenario.dt_s)
        return np.asarray(np.array([leg.end for leg in self._legs])[phase] - steps_left)

    def _scatter(self) -> tuple[Array, Array]:
        """Scatter of the position (num_steps + 1,), m, and of the thrust (num_steps,), m/s^2, with their factors."""
        gains, steps = self.gains, self.scenario.num_steps
        if gains.error_scatter == gains.thrust_scatter == 0:
            return np.zeros(steps + 1), np.zeros(steps)
        error, thrust = episode_scatter(self.scenario)
        return gains.error_scatter * error, gains.thrust_scatter * thrust

    def _thrust_ahead(self, nodes: NDArray[np.intp]) -> Array:
        """Mean scatter of the thrust in each block (N,), m/s^2; none in the first, whose thrust is decided now."""
        ahead = np.add.reduceat(self._thrust_scatter[: nodes[-1]], nodes[:-1]) / np.diff(nodes)
        ahead[0] = 0.0
        return ahead

    def _span(self, start: int, end: int) -> DiscreteModel:
        """The filter's model from one instant to another under constant thrust."""
        key = (0, end - start) if self._model.Phi.ndim == 2 else (start, end)
        if key not in self._spans:
            model = self._model.steps(*key).from_start()
            self._spans[key] = DiscreteModel(model.Phi[-1], model.Gamma[-1], model.delta[-1])
        return self._spans[key]


def _first(plan: Plan) -> Array:
    """The thrust (3,) to give now, m/s^2; a solver that broke down gives none."""
    thrust: Array = plan.controls[0]
    return thrust if np.isfinite(thrust).all() else np.zeros(3)
