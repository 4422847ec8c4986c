"""Model predictive control: at each step the plan of least cost from the estimate on; its first thrust is given.

A plan looks ahead through the schedule, across arrivals and changes of phase, to a given hold time from now; as the end
of the episode comes near, its horizon shrinks. It knows that errors and thrust will scatter about it: by how much
`baselines.design.reweighted_lqg` says. Without that, each new estimate's noise would be answered by a thrust.
"""

import warnings

import numpy as np
from numpy.typing import NDArray

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.search_space import Parameter
from baselines.design.phase_tables import read_instants
from baselines.optimal.cone_program import ConeProgram, Plan
from baselines.optimal.cone_solver import SOLVER
from baselines.optimal.receding_horizon import MPCSettings, RecedingHorizon
from formation_env.numerics.arrays import Array, Observations
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import legs


class MPC(AccelerationPolicy):
    """The first thrust of the plan of least cost by the filter's model, a second-order cone program.

    It has no memory: all rows at the same instant share one program, and differ by its right-hand side. Where the
    solver fails, the plan that it came to is flown if it is finite, else the follower coasts for a step; the first
    failure of a policy is reported as a RuntimeWarning, and `failed_plans` counts them all.
    """

    name = "mpc"
    Settings = MPCSettings
    settings: MPCSettings
    search_space = (
        Parameter(("error_weight_scale",), 0.3, 3),
        Parameter(("error_scatter",), 0, 3, log=False),
        Parameter(("thrust_scatter",), 0, 2, log=False),
    )
    library = SOLVER
    slow = True
    color, symbol = "#C2408A", "star"

    def __init__(self, scenario: Scenario, settings: MPCSettings) -> None:
        super().__init__(scenario, settings)
        self._layout, self._horizon = observation_layout(scenario), RecedingHorizon(scenario, settings)
        self._ends = np.array([leg.end for leg in legs(scenario)])
        self.failed_plans = 0

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        rows = observation.reshape(-1, observation.shape[-1])
        estimates, instants = self._layout.estimate(rows), self._instants(rows)
        result = np.zeros((len(rows), 3))
        for instant in np.unique(instants[instants < self.scenario.num_steps]):
            program = self.program(int(instant))
            for row in np.flatnonzero(instants == instant):
                result[row] = self._first_thrust(program.solve(estimates[row]), int(instant))
        return result.reshape(*observation.shape[:-1], 3)

    def program(self, instant: int) -> ConeProgram:
        """The program of a plan from an instant on, in steps.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        return self._horizon.program(instant)

    def _instants(self, rows: Observations) -> NDArray[np.intp]:
        """Instants of rows of observations, in steps."""
        phase, steps_left = read_instants(rows, self._layout, self.scenario.dt_s)
        return np.asarray(self._ends[phase] - steps_left)

    def _first_thrust(self, plan: Plan, instant: int) -> Array:
        """Thrust (3,) to give now, m/s^2."""
        thrust: Array = plan.controls[0]
        finite = bool(np.isfinite(thrust).all())
        if not (plan.solved and finite):
            self._report_failure(plan.status, instant, "the unfinished plan is flown" if finite else "it coasts")
        return thrust if finite else np.zeros(3)

    def _report_failure(self, status: str, instant: int, remedy: str) -> None:
        """Count a failure of the solver, and warn of the first."""
        self.failed_plans += 1
        if self.failed_plans == 1:
            warnings.warn(
                f"mpc: the cone solver ended with status {status} at step {instant}; {remedy} for this step "
                "(reported once, counted in failed_plans)",
                RuntimeWarning,
                stacklevel=2,
            )
