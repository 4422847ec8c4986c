"""A control problem with the environment's cost as a second-order cone program: for whole episodes and for horizons.

    minimise  sum dt_j |(u_j, sigma_j)| + sum w_j (linear s_j + quadratic s_j^2),   s_j = |(x_j - r_j, rho_j)|
    so that   x_(j+1) = F_j x_j + G_j u_j + d_j,   |u_j| <= limit_j along each axis,   x_m = goal_m at the instants met,
              n_k . position_k >= least_k at the instants kept off

over blocks j of one or more steps, each of constant thrust. A block couples neighbours only, so the program is sparse
and its solution takes a time in proportion to the blocks. sigma and rho are the expected scatter of thrust and position
about the plan: where something scatters anyway, a little more costs next to nothing, as E|e + w| is flat at e = 0.

Legend: F, G, d the model over a block; x states at the blocks' ends, u accelerations, t >= |(u, sigma)|,
s >= |(x - r, rho)|. Variables in order: x (6 N), u (3 N), t (N), s (one for each error with a weight).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from baselines.optimal.cone_solver import EXACT, Cones, ConeSolver
from formation_env.numerics.arrays import Array
from formation_env.task.reward import ErrorCost


@dataclass(frozen=True)
class ControlProblem:
    """A control problem in N blocks.

    Attributes:
        F: transition matrices (N, 6, 6).
        G: input matrices (N, 6, 3).
        d: effects of the constant disturbance (N, 6).
        duration_s: of the blocks (N,), s.
        limit_m_s2: greatest acceleration along each axis (N,), m/s^2.
        place_m: positions at the blocks' ends that errors are counted from (N, 3), m.
        error_weight: weight of the error there (N,), (m/s) per m.
        cost: cost of an error per unit of its weight.
        error_scatter_m: rms scatter of the position about the plan there (N,), m; None is none anywhere.
        thrust_scatter_m_s2: rms scatter of the acceleration in the blocks (N,), m/s^2; given along with the other.
        met: blocks at whose ends the state must be the goal.
        goal: states (met, 6), m and m/s.
        kept: blocks at whose ends the position must be in a half-space (kept,); a block may stand there several times.
        normals: unit vectors (kept, 3).
        least_m: normal . position is at least this (kept,), m.
    """

    F: Array
    G: Array
    d: Array
    duration_s: Array
    limit_m_s2: Array
    place_m: Array
    error_weight: Array
    cost: ErrorCost
    error_scatter_m: Array | None = None
    thrust_scatter_m_s2: Array | None = None
    met: tuple[int, ...] = ()
    goal: Array | None = None
    kept: tuple[int, ...] = ()
    normals: Array | None = None
    least_m: Array | None = None


@dataclass(frozen=True)
class Units:
    """Units of the program; the solver likes numbers near 1. That of the cost is accel_m_s2 * time_s.

    Attributes:
        length_m: of positions.
        speed_m_s: of velocities.
        accel_m_s2: of thrust in the cost.
        time_s: of durations in the cost.
    """

    length_m: float
    speed_m_s: float
    accel_m_s2: float = 1.0
    time_s: float = 1.0


@dataclass(frozen=True)
class Solution:
    """A plan and the multipliers that prove it.

    Attributes:
        controls: accelerations (N, 3), m/s^2.
        multipliers: of the errors from the start on (N + 1, 6), m/s per m and per m/s, see `certificate`.
    """

    controls: Array
    multipliers: Array


@dataclass(frozen=True)
class Plan:
    """The solver's plan.

    Attributes:
        cost_m_s: of the problem, m/s.
        states: at the blocks' ends (N, 6), m and m/s.
        controls: accelerations (N, 3), m/s^2.
        solved: whether the solver reached its tolerance, or nearly so.
        status: the solver's own word for how it ended.
        z: multipliers of the program's rows, in its units.
    """

    cost_m_s: float
    states: Array
    controls: Array
    solved: bool
    status: str
    z: Array


# Long: the rows of the program are best read at one place.
class ConeProgram:
    """A problem's program, laid out once and solved for any number of starts, which change the right-hand side only."""

    def __init__(self, problem: ControlProblem, units: Units, *, tolerance: float = EXACT) -> None:
        """Lay out the matrices.

        Args:
            problem: the problem.
            units: of the program.
            tolerance: relative, of the solver's residuals and duality gap.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        self._problem, self._units = problem, units
        self._scale = np.repeat([units.length_m, units.speed_m_s], 3)
        self._count = len(problem.F)
        self._weighted = np.flatnonzero(problem.error_weight > 0)
        parts = [
            self._motion(),
            self._meeting(),
            self._box(),
            self._half_spaces(),
            self._thrust_cones(),
            self._error_cones(),
        ]
        A = sparse.vstack([matrix for matrix, _ in parts]).tocsc()
        self._b = np.concatenate([b for _, b in parts])
        zero, positive = len(parts[0][1]) + len(parts[1][1]), len(parts[2][1]) + len(parts[3][1])
        P, q = self._objective()
        cones = Cones(zero, positive, self._count + len(self._weighted), self._cone_size)
        self._solver = ConeSolver(P, q, A, cones, tolerance=tolerance)

    def solve(self, start: Array) -> Plan:
        """The best plan from a start (6,), m and m/s.

        Raises:
            UnreachableError: no thrust within the limit meets the goals.
        """
        h, n, b = self._problem, self._count, self._b.copy()
        b[:6] = (h.F[0] @ start + h.d[0]) / self._scale
        solution = self._solver.solve(b)
        x = solution.x
        return Plan(
            cost_m_s=solution.cost * self._cost_unit,
            states=x[: 6 * n].reshape(n, 6) * self._scale,
            controls=x[6 * n : 9 * n].reshape(n, 3) * h.limit_m_s2[:, None],
            solved=solution.solved,
            status=solution.status,
            z=solution.z,
        )

    def multipliers(self, plan: Plan) -> Array:
        """Multipliers (N + 1, 6) of the errors, from the start on, see `certificate`, m/s per m and per m/s."""
        h, result = self._problem, np.zeros((self._count + 1, 6))
        cones = plan.z[len(plan.z) - self._cone_size * len(self._weighted) :].reshape(-1, self._cone_size)
        result[1 + self._weighted, :3] = -cones[:, 1:4] / self._units.length_m * self._cost_unit
        meeting = plan.z[6 * self._count : 6 * (self._count + len(h.met))].reshape(-1, 6)
        result[[1 + block for block in h.met]] = meeting / self._scale * self._cost_unit
        return result

    @property
    def _cost_unit(self) -> float:
        """Unit of the cost, m/s."""
        return self._units.accel_m_s2 * self._units.time_s

    @property
    def _cone_size(self) -> int:
        """Rows of each cone: a length, three axes, and the scatter."""
        return 4 if self._problem.error_scatter_m is None else 5

    def _width(self) -> int:
        """Number of variables."""
        return 10 * self._count + len(self._weighted)

    def _objective(self) -> tuple[Any, Array]:
        """P and q of x'Px / 2 + q'x."""
        h, n, length, unit = self._problem, self._count, self._units.length_m, self._cost_unit
        thrust = h.duration_s / self._units.time_s * (h.limit_m_s2 / self._units.accel_m_s2)
        weight = h.error_weight[self._weighted] * length / unit
        P = np.concatenate([np.zeros(10 * n), 2 * weight * h.cost.quadratic * length])
        return sparse.diags(P).tocsc(), np.concatenate([np.zeros(9 * n), thrust, weight * h.cost.linear])

    def _motion(self) -> tuple[Any, Array]:
        """x_(j+1) - F_j x_j - G_j u_j = d_j."""
        h, n, scale = self._problem, self._count, self._scale
        F, G = h.F * scale / scale[:, None], h.G * h.limit_m_s2[:, None, None] / scale[:, None]
        along = np.arange(n)
        # F of the first block acts on the start, which stands on the right-hand side
        past = sparse.bsr_array((F[1:], along[: n - 1], np.concatenate([[0], along])), shape=(6 * n, 6 * n))
        push = sparse.bsr_array((G, along, np.arange(n + 1)), shape=(6 * n, 3 * n))
        rest = sparse.csc_array((6 * n, n + len(self._weighted)))
        return sparse.hstack([sparse.eye_array(6 * n) - past, -push, rest]), (h.d / scale).ravel()

    def _meeting(self) -> tuple[Any, Array]:
        """x = goal at the ends of the blocks met."""
        met = np.array(self._problem.met, int)
        columns = (6 * met[:, None] + np.arange(6)).ravel()
        goal = np.zeros(0) if self._problem.goal is None else (self._problem.goal / self._scale).ravel()
        return self._picked(np.arange(6 * len(met)), columns, 6 * len(met), 1.0), goal

    def _box(self) -> tuple[Any, Array]:
        """-1 <= u <= 1 along each axis, in units of the limit."""
        n = self._count
        both = sparse.vstack([sparse.eye_array(3 * n), -sparse.eye_array(3 * n)])
        rest = sparse.csc_array((6 * n, n + len(self._weighted)))
        return sparse.hstack([sparse.csc_array((6 * n, 6 * n)), both, rest]), np.ones(6 * n)

    def _half_spaces(self) -> tuple[Any, Array]:
        """n . x >= least at the ends of the blocks kept off."""
        h, count, length = self._problem, len(self._problem.kept), self._units.length_m
        if h.normals is None or h.least_m is None:
            return sparse.csc_array((0, self._width())), np.zeros(0)
        rows, columns = np.repeat(np.arange(count), 3), (6 * np.array(h.kept)[:, None] + [0, 1, 2]).ravel()
        matrix = sparse.csc_array((-h.normals.ravel(), (rows, columns)), shape=(count, self._width()))
        return matrix, -h.least_m / length

    def _thrust_cones(self) -> tuple[Any, Array]:
        """(t_j, u_j, sigma_j) in the cone."""
        h, n = self._problem, self._count
        b = np.zeros((n, self._cone_size))
        if h.thrust_scatter_m_s2 is not None:
            b[:, 4] = h.thrust_scatter_m_s2 / h.limit_m_s2
        return self._cones(9 * n + np.arange(n), 6 * n + 3 * np.arange(n)), b.ravel()

    def _error_cones(self) -> tuple[Any, Array]:
        """(s_j, x_j - r_j, rho_j) in the cone, at the blocks' ends whose errors have a weight."""
        h, weighted, length = self._problem, self._weighted, self._units.length_m
        b = np.zeros((len(weighted), self._cone_size))
        b[:, 1:4] = -h.place_m[weighted] / length
        if h.error_scatter_m is not None:
            b[:, 4] = h.error_scatter_m[weighted] / length
        return self._cones(10 * self._count + np.arange(len(weighted)), 6 * weighted), b.ravel()

    def _cones(self, lengths: NDArray[np.intp], vectors: NDArray[np.intp]) -> Any:
        """Rows of cones, given the columns of their lengths and of the first of three components."""
        first = self._cone_size * np.arange(len(lengths))
        rows = np.concatenate([first, (first[:, None] + [1, 2, 3]).ravel()])
        columns = np.concatenate([lengths, (vectors[:, None] + [0, 1, 2]).ravel()])
        return self._picked(rows, columns, self._cone_size * len(lengths), -1.0)

    def _picked(self, rows: NDArray[np.intp], columns: NDArray[np.intp], height: int, value: float) -> Any:
        """Rows (height, variables) with one value at some places."""
        return sparse.csc_array((np.full(len(rows), value), (rows, columns)), shape=(height, self._width()))
