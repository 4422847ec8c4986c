"""The fuel optimum of an episode, solved, proved and kept."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from baselines.optimal import solution_cache
from baselines.optimal.certificate import delta_v, fly_plan, lower_bound, plan_cost
from baselines.optimal.cone_program import Solution, solve
from baselines.optimal.problem import Problem, episode_problem
from formation_env.numerics.arrays import Array
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

LARGEST_GAP_M_S: Final = 1e-5
"""Between the plan's cost and the bound; a wider one is no solution."""


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
    """Least cost of the environment's own objective, had one known everything beforehand.

    The true start and all disturbances are known; time grid, thrust limit of each axis and true linear dynamics are the
    environment's. So it is a lower bound for every policy on that seed, as long as the episode runs to its end: early
    ends are not in the program (one costs what staying at the distance limit does, which is far more).
    A minimum thrust is left out, which only lowers the bound. The thruster's random error is known like the rest: step
    by step it scales the limit, and the acceleration that acts is what costs.

    Args:
        scenario: a registered id, a scenario's name or path, or a Scenario, with a linear truth.
        seed: of the episode whose start and disturbances are met.
        initial_state: LVLH state (6,) to start at undisturbed, m and m/s; without it and without a seed the nominal
            start.
        exact_arrival: in place of the price of errors, be at the reference at the two ends of each transfer, but for
            the very start; between them errors are free.
        cache_folder: where plans are kept; none are without it.

    Raises:
        ValueError: a nonlinear truth, both a seed and a state, a state of wrong shape, no transfer to arrive from, or
            an arrival out of the thruster's reach.
        RuntimeError: the solver failed.
        OSError: the folder cannot be written.
        ModuleNotFoundError: Clarabel is not installed; it comes with the extra `optimal`.
    """
    scenario = load_scenario(scenario)
    problem = episode_problem(scenario, seed, initial_state, exact_arrival)
    if cache_folder is None:
        return _solve(problem)[0]
    place = solution_cache.solution_entry(cache_folder, scenario, seed, initial_state, exact_arrival)
    cached = solution_cache.read(place, len(problem.Phi))
    # A cached solution is certified on today's problem, so that nothing stale passes.
    if cached is not None and _is_optimal(plan := _judge(problem, cached)):
        return plan
    plan, solution = _solve(problem)
    solution_cache.write(place, solution)
    return plan


def _solve(problem: Problem) -> tuple[OptimalPlan, Solution]:
    solution = solve(problem)
    plan = _judge(problem, solution)
    if not _is_optimal(plan):
        raise RuntimeError(f"fuel_optimal: the solver left a gap of {plan.gap:.3g} m/s, above {LARGEST_GAP_M_S:g} m/s")
    return plan, solution


def _judge(problem: Problem, solution: Solution) -> OptimalPlan:
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
