"""What a plan costs, and a proof that nothing costs less: both in plain arithmetic that trusts no solver.

For any multipliers y_j, |e| >= y.e / price as long as |y| <= price. The cost is then at least a sum over the instants
plus, for each step, the least of |u| dt + q.u within the thrust limit, where the adjoint q = Gamma' lambda is Lawden's
primer vector (Lawden 1963, "Optimal Trajectories for Space Navigation"; times -dt): weak duality.

Legend: y multipliers, lambda adjoint state, q primer vector.
"""

import numpy as np

from baselines.optimal.problem import Problem
from formation_env.numerics.arrays import Array


def fly_plan(problem: Problem, controls: Array) -> Array:
    """States (steps + 1, 6) under accelerations (steps, 3), m/s^2."""
    forced = np.zeros_like(problem.free_path)
    for k, thrust in enumerate(controls):
        forced[k + 1] = problem.Phi[k] @ forced[k] + problem.Gamma[k] @ thrust
    return problem.free_path + forced


def delta_v(problem: Problem, controls: Array) -> float:
    """Sum of |u| dt, m/s."""
    return float(problem.dt_s * np.linalg.norm(controls, axis=1).sum())


def plan_cost(problem: Problem, states: Array, controls: Array) -> float:
    """The environment's cost of a plan, m/s."""
    error = np.linalg.norm((states - problem.goal)[:, :3], axis=1)
    shaped = problem.linear * error + problem.quadratic * error**2
    return delta_v(problem, controls) + float(problem.price @ shaped)


def lower_bound(problem: Problem, multipliers: Array) -> float:
    """No plan within the thrust limit costs less, m/s, whatever the multipliers are; rounding aside, 1e-12 of it.

    Args:
        problem: the problem.
        multipliers: (steps + 1, 6), m/s per m and per m/s.
    """
    y, conjugate = _feasible(problem, multipliers)
    adjoint, q = np.zeros(6), np.zeros((len(problem.Phi), 3))
    for k in range(len(problem.Phi) - 1, -1, -1):
        adjoint = y[k + 1] + (problem.Phi[k + 1].T @ adjoint if k + 1 < len(problem.Phi) else 0)
        q[k] = problem.Gamma[k].T @ adjoint
    return float((y * problem.miss).sum() - conjugate + (problem.limit * least_of_steps(q, problem.dt_s)).sum())


def _feasible(problem: Problem, multipliers: Array) -> tuple[Array, float]:
    """The multipliers cut to what bounds the price of errors from below, and what a quadratic price takes off, m/s."""
    y, met = multipliers.copy(), list(problem.met)
    y[:, 3:], conjugate = 0, 0.0
    judged = problem.price > 0
    y[~judged] = 0
    if problem.linear:
        # price |e| >= y.e if |y| <= price
        length = np.linalg.norm(y, axis=1)
        y[judged] *= np.minimum(1, problem.price[judged] / np.maximum(length[judged], 1e-300))[:, None]
    else:
        # price c |e|^2 >= y.e - |y|^2 / (4 price c)
        conjugate = float(((y[judged] ** 2).sum(axis=1) / (4 * problem.price[judged] * problem.quadratic)).sum())
    y[met] = multipliers[met]
    return y, conjugate


def least_of_steps(q: Array, dt_s: float) -> Array:
    """Least of |u| dt + q.u over the cube |u_i| <= 1 for each q (..., 3).

    It is minus the distance from q to the ball of radius dt in the 1-norm: of the points of the ball, the one with
    w_i = min(|q_i|, level) is nearest.
    """
    size = np.sort(np.abs(q), axis=-1)
    rest = dt_s**2 - np.concatenate([np.zeros((*q.shape[:-1], 1)), np.cumsum(size**2, axis=-1)[..., :2]], axis=-1)
    # if the i smallest components stay below the level, it is sqrt((dt^2 - their squares) / (3 - i))
    levels = np.sqrt(np.maximum(rest, 0) / np.array([3, 2, 1]))
    fits = size >= levels
    level = np.where(fits.any(axis=-1), np.take_along_axis(levels, fits.argmax(axis=-1)[..., None], -1)[..., 0], np.inf)
    return np.asarray(-np.maximum(size - level[..., None], 0).sum(axis=-1))
