"""The fuel optimum as a second-order cone program.

The variables are what the thrust adds to the state after each step, the thrust, its length, and the length of the
position error at each judged instant; a step couples neighbours only, so the program is sparse and its solution takes a
time in proportion to the steps.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from baselines.optimal.cone_solver import UnreachableError, solve_cones
from baselines.optimal.problem import Problem
from formation_env.numerics.arrays import Array

LENGTH_M: Final = 1000.0
"""Unit of positions in the program."""
RATE_PER_S: Final = 1e-3
"""Unit of velocities in it, over that of positions; about a mean motion."""
_UNITS: Final = LENGTH_M * np.repeat([1.0, RATE_PER_S], 3)
_LENGTH: Final = np.eye(4, 1)
_VECTOR: Final = np.eye(4, 3, -1)

IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class Solution:
    """What the solver found.

    Attributes:
        controls: accelerations (steps, 3), m/s^2.
        multipliers: (steps + 1, 6), m/s per m and per m/s, see `certificate`.
    """

    controls: Array
    multipliers: Array


@dataclass(frozen=True)
class _Rows:
    """Rows A x + s = b of the program, with s in a cone."""

    A: Any
    b: Array


def solve(problem: Problem) -> Solution:
    """Solve a problem.

    Raises:
        ValueError: no thrust within the limit meets the states to be met.
        ModuleNotFoundError: Clarabel is not installed.
    """
    rows = [_motion(problem), _meeting(problem), _box(problem), _thrusts(problem), _errors(problem)]
    P, cost = _objective(problem)
    A, b = sparse.vstack([part.A for part in rows], format="csc"), np.concatenate([part.b for part in rows])
    sizes = [len(part.b) for part in rows]
    try:
        x, z = solve_cones(P, cost, A, b, sizes[0] + sizes[1], sizes[2], (sizes[3] + sizes[4]) // 4)
    except UnreachableError as error:
        raise ValueError(
            f"exact_arrival: no thrust of at most {problem.limit.max():g} m/s^2 along each axis meets the reference at "
            f"the steps {list(problem.met)}"
        ) from error
    return _read(problem, x, z)


def _coned(problem: Problem) -> IntArray:
    """Instants whose error's length is a variable: those with a linear price."""
    return np.flatnonzero(problem.price * problem.linear)


def _beside(problem: Problem, states: Any = None, thrust: Any = None, length: Any = None, error: Any = None) -> Any:
    """Columns of the variables side by side; those not given are zero."""
    steps = len(problem.Phi)
    widths, blocks = (6 * steps, 3 * steps, steps, len(_coned(problem))), (states, thrust, length, error)
    height = next(block.shape[0] for block in blocks if block is not None)
    filled = [sparse.csr_array((height, w)) if x is None else x for x, w in zip(blocks, widths, strict=True)]
    return sparse.hstack(filled, format="csr")


def _motion(problem: Problem) -> _Rows:
    """f(k+1) - Phi f(k) - Gamma u(k) = 0 from f(0) = 0."""
    steps = len(problem.Phi)
    Phi = problem.Phi * _UNITS / _UNITS[:, None]
    Gamma = problem.Gamma * problem.limit[:, None, None] / _UNITS[:, None]
    size, before = (6 * steps, 6 * steps), np.concatenate([[0], np.arange(steps)])
    states = sparse.eye_array(6 * steps) - sparse.bsr_array((Phi[1:], np.arange(steps - 1), before), shape=size)
    thrust = sparse.bsr_array((-Gamma, np.arange(steps), np.arange(steps + 1)), shape=(6 * steps, 3 * steps))
    return _Rows(_beside(problem, states, thrust), np.zeros(6 * steps))


def _pick(problem: Problem, instants: IntArray, block: Array) -> Any:
    """Rows that take a block (rows, 6) of the state at each of some instants, the first of which is 1."""
    chosen = sparse.eye_array(len(problem.Phi), format="csr")[instants - 1]
    return sparse.kron(chosen, block)


def _meeting(problem: Problem) -> _Rows:
    """f = goal - free path, at the instants to be met."""
    met = np.array(problem.met, int)
    return _Rows(_beside(problem, _pick(problem, met, np.eye(6))), -(problem.miss[met] / _UNITS).ravel())


def _box(problem: Problem) -> _Rows:
    """-1 <= u <= 1, in units of the limit."""
    axes = sparse.eye_array(3 * len(problem.Phi))
    return _Rows(_beside(problem, thrust=sparse.vstack([axes, -axes])), np.ones(6 * len(problem.Phi)))


def _thrusts(problem: Problem) -> _Rows:
    """(length, u) in the cone, at each step."""
    each = sparse.eye_array(len(problem.Phi))
    return _Rows(
        _beside(problem, thrust=sparse.kron(each, -_VECTOR), length=sparse.kron(each, -_LENGTH)),
        np.zeros(4 * len(problem.Phi)),
    )


def _errors(problem: Problem) -> _Rows:
    """(length, f + miss) in the cone, positions only, at each instant with a linear price."""
    judged = _coned(problem)
    states = _pick(problem, judged, -_VECTOR @ np.eye(3, 6))
    lengths = sparse.kron(sparse.eye_array(len(judged)), -_LENGTH)
    return _Rows(
        _beside(problem, states=states, error=lengths), (problem.miss[judged, :3] / LENGTH_M @ _VECTOR.T).ravel()
    )


def _objective(problem: Problem) -> tuple[Any, Array]:
    """P and q of x'Px / 2 + q'x, m/s."""
    judged = _coned(problem)
    lengths, errors = problem.dt_s * problem.limit, problem.price[judged] * LENGTH_M
    steps, price = len(problem.Phi), problem.quadratic * problem.price[1:]
    # c |f + miss|^2 = c |f|^2 + 2 c miss.f + a constant
    squares, slopes = np.zeros((2, steps, 6))
    squares[:, :3] = 2 * price[:, None] * LENGTH_M**2
    slopes[:, :3] = 2 * price[:, None] * LENGTH_M * problem.miss[1:, :3]
    rest = np.zeros(4 * steps + len(judged))
    P = sparse.csc_array(sparse.diags_array(np.concatenate([squares.ravel(), rest])))
    return P, np.concatenate([slopes.ravel(), np.zeros(3 * steps), lengths, errors])


def _read(problem: Problem, x: Array, z: Array) -> Solution:
    """The plan and the multipliers of the errors, in SI units."""
    steps, judged, met = len(problem.Phi), _coned(problem), list(problem.met)
    forced, thrust = x[: 6 * steps].reshape(-1, 6) * _UNITS, x[6 * steps : 9 * steps].reshape(-1, 3)
    multipliers = np.zeros((steps + 1, 6))
    multipliers[1:, :3] = 2 * (problem.quadratic * problem.price[1:, None]) * (forced + problem.miss[1:])[:, :3]
    multipliers[judged, :3] = -z[len(z) - 4 * len(judged) :].reshape(-1, 4)[:, 1:] / LENGTH_M
    multipliers[met] = z[6 * steps : 6 * (steps + len(met))].reshape(-1, 6) / _UNITS
    return Solution(problem.limit[:, None] * np.clip(thrust, -1, 1), multipliers)
