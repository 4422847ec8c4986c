"""The perfect-information optimum of an episode, solved, certified and cached."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from baselines.optimal import solution_cache
from baselines.optimal.certificate import delta_v, fly_plan, lower_bound, plan_cost
from baselines.optimal.cone_program import ConeProgram, ControlProblem, Solution, Units
from baselines.optimal.cone_solver import SolverError, UnreachableError
from baselines.optimal.problem import Problem, episode_problem
from formation_env.numerics.arrays import Array
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

LARGEST_GAP_M_S: Final = 1e-5
"""Between the plan's cost and the bound; a wider one is no solution."""
_UNITS: Final = Units(length_m=1000.0, speed_m_s=1.0)
"""Units of the program: distances are km, and a speed is about a mean motion, 1e-3 1/s, times that."""


@dataclass(frozen=True)
class OptimalPlan:
    """The cheapest plan of an episode.

    Attributes:
        cost: no plan costs less, m/s: the certified lower bound.
        delta_v_m_s: of the plan.
        states: LVLH states (steps + 1, 6), m and m/s.
        controls: accelerations that act (steps, 3), m/s^2.
        gap: what the plan costs above `cost`, m/s.
    """

    cost: float
    delta_v_m_s: float
    states: Array
    controls: Array
    gap: float


def fuel_optimal(
    scenario: str | Path | Scenario,
    *,
    seed: int | None = None,
    initial_state: ArrayLike | None = None,
    exact_arrival: bool = False,
    cache_folder: Path | None = None,
) -> OptimalPlan:
    """Perfect-information lower bound (hindsight optimum) of an episode's cost, by the environment's own objective.

    Time grid, thrust limit and true linear dynamics are the environment's; start and disturbances are known, and so is
    the thruster's random error, which scales the limit of each step. So no policy costs less on that seed, as long as
    the episode runs to its end: an early end costs as much as staying at the distance limit, which is far more. A
    minimum thrust is left out, which only lowers the bound.

    Args:
        scenario: a registered id, a scenario's name or path, or a Scenario, with a linear truth.
        seed: of the episode whose start and disturbances are met.
        initial_state: LVLH state (6,) to start at undisturbed, m and m/s; without it and without a seed the nominal
            start.
        exact_arrival: meet the reference at the ends of each transfer instead of weighing errors.
        cache_folder: folder of cached plans; None disables caching.

    Raises:
        ValueError: an impossible problem, see `episode_problem`, or an arrival out of the thruster's reach.
        SolverError: the solver failed (a RuntimeError).
        OSError: the folder cannot be written.
        ModuleNotFoundError: Clarabel is not installed; it comes with the extra `optimal`.
    """
    scenario = load_scenario(scenario)
    problem = episode_problem(scenario, seed, initial_state, exact_arrival)
    if cache_folder is None:
        return _solve(problem)[0]
    place = solution_cache.solution_entry(cache_folder, scenario, seed, initial_state, exact_arrival)
    cached = solution_cache.read(place, len(problem.Phi))
    # A cached plan is certified on today's problem, so that nothing stale passes.
    if cached is not None and _is_optimal(plan := _certify(problem, cached)):
        return plan
    plan, solution = _solve(problem)
    solution_cache.write(place, solution)
    return plan


def solve_episode(problem: Problem) -> Solution:
    """Solve a problem; the caller certifies the solution.

    Raises:
        ValueError: no thrust within the limit meets the states to be met.
        ModuleNotFoundError: Clarabel is not installed.
    """
    # the program's states are what the thrust adds to the free path
    met = np.array(problem.met, int)
    control_problem = ControlProblem(
        F=problem.Phi,
        G=problem.Gamma,
        d=np.zeros((len(problem.Phi), 6)),
        duration_s=np.full(len(problem.Phi), problem.dt_s),
        limit_m_s2=problem.limit,
        place_m=-problem.miss[1:, :3],
        error_weight=problem.error_weight[1:],
        cost=problem.cost,
        met=tuple((met - 1).tolist()),
        goal=-problem.miss[met],
    )
    program = ConeProgram(control_problem, _UNITS)
    try:
        plan = program.solve(np.zeros(6))
    except UnreachableError as error:
        raise ValueError(
            f"exact_arrival: no thrust of at most {problem.limit.max():g} m/s^2 along each axis meets the reference at "
            f"the steps {list(problem.met)}"
        ) from error
    return Solution(plan.controls, program.multipliers(plan))


def _solve(problem: Problem) -> tuple[OptimalPlan, Solution]:
    solution = solve_episode(problem)
    plan = _certify(problem, solution)
    if not _is_optimal(plan):
        raise SolverError(f"fuel_optimal: the solver left a gap of {plan.gap:.3g} m/s, above {LARGEST_GAP_M_S:g} m/s")
    return plan, solution


def _certify(problem: Problem, solution: Solution) -> OptimalPlan:
    controls = np.clip(solution.controls, -problem.limit[:, None], problem.limit[:, None])
    states, bound = fly_plan(problem, controls), lower_bound(problem, solution.multipliers)
    return OptimalPlan(
        cost=bound,
        delta_v_m_s=delta_v(problem, controls),
        states=states,
        controls=controls,
        gap=plan_cost(problem, states, controls) - bound,
    )


def _is_optimal(plan: OptimalPlan) -> bool:
    return abs(plan.gap) <= LARGEST_GAP_M_S
