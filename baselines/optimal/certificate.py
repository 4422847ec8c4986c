"""Cost of a plan, and a certificate that nothing costs less: both in plain arithmetic that trusts no solver.

For any multipliers y_j, w |e| >= y.e as long as |y| is at most the error weight w. The cost is then at least a sum over
the instants plus, for each step, the least of |u| dt + q.u within the thrust limit, where the adjoint q = Gamma' lambda
is Lawden's primer vector (Lawden 1963, "Optimal Trajectories for Space Navigation"; times -dt): weak duality.

Legend: y multipliers, lambda adjoint state, q primer vector.
"""

from typing import Final

import numpy as np

from baselines.optimal.problem import Problem
from formation_env.numerics.arrays import Array

_NO_LENGTH: Final = 1e-300
"""Length that stands in for 0, to divide by."""


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
    return delta_v(problem, controls) + float(problem.error_weight @ problem.cost.of(error))


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
    """Multipliers cut to what bounds the cost of errors from below, and the conjugate of a quadratic cost, m/s."""
    y, met = multipliers.copy(), list(problem.met)
    y[:, 3:], conjugate = 0, 0.0
    weighted = problem.error_weight > 0
    y[~weighted], weight = 0, problem.error_weight[weighted]
    if problem.cost.linear:
        # w |e| >= y.e if |y| <= w
        length = np.linalg.norm(y, axis=1)
        y[weighted] *= np.minimum(1, weight / np.maximum(length[weighted], _NO_LENGTH))[:, None]
    else:
        # w c |e|^2 >= y.e - |y|^2 / (4 w c)
        conjugate = float(((y[weighted] ** 2).sum(axis=1) / (4 * weight * problem.cost.quadratic)).sum())
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
