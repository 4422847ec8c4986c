"""A stretch of the environment's own cost as a second-order cone program, and its solution by Clarabel.

    minimise  sum dt_j |(u_j, sigma_j)| + sum price_j |(x_j - r_j, rho_j)|
    so that   x_(j+1) = F_j x_j + G_j u_j + d_j,   |u_j| <= limit along each axis

over blocks j of one or more steps, each of constant thrust. sigma and rho are how far thrust and position will scatter
about the plan, as the noises do their work and later plans answer them: where something scatters anyway, a little more
of it costs next to nothing, since E|e + w| is flat at e = 0. With sigma = rho = 0 it is the cost without noise.

Legend: F, G, d the model over a block; x states, u accelerations, t >= |(u, sigma)|, s >= |(x - r, rho)|.
"""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

import numpy as np
from scipy import sparse

from formation_env.numerics.arrays import Array

TOLERANCE: Final = 1e-6
"""Gap between the primal and the dual cost at which the solver stops, relative and in its own units."""


@dataclass(frozen=True)
class Horizon:
    """A control problem from an instant on, in N blocks.

    Attributes:
        F: transition matrices (N, 6, 6).
        G: input matrices (N, 6, 3).
        d: effects of the constant disturbance (N, 6).
        duration_s: of the blocks (N,), s.
        place_m: where the follower should be at the blocks' ends (N, 3), m.
        price: of an error there (N,), (m/s) per m.
        error_scatter_m: how far the position will scatter about the plan's there (N,), m.
        thrust_scatter_m_s2: how far the acceleration will scatter about the plan's in the blocks (N,), m/s^2.
        limit_m_s2: greatest acceleration along each axis, m/s^2.
        steepness_per_m: None if the cost grows with the error; if with its square, that is multiplied by this, 1/m.
    """

    F: Array
    G: Array
    d: Array
    duration_s: Array
    place_m: Array
    price: Array
    error_scatter_m: Array
    thrust_scatter_m_s2: Array
    limit_m_s2: float
    steepness_per_m: float | None = None


@dataclass(frozen=True)
class Plan:
    """A solution.

    Attributes:
        cost_m_s: of the horizon, m/s.
        states: at the blocks' ends (N, 6), m and m/s.
        controls: accelerations (N, 3), m/s^2.
        solved: whether the solver reached its tolerance, or came near.
    """

    cost_m_s: float
    states: Array
    controls: Array
    solved: bool


class ConeProgram:
    """A horizon's program, made once and solved for many starts; the starts change the right-hand side only."""

    def __init__(self, horizon: Horizon, length_m: float, speed_m_s: float) -> None:
        """Lay out the matrices.

        Args:
            horizon: what to solve.
            length_m: unit of lengths in the program; the solver likes numbers near 1.
            speed_m_s: unit of speeds.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        self._horizon, self._length_m = horizon, length_m
        self._scale = np.repeat([length_m, speed_m_s], 3)
        self._count = len(horizon.F)
        self._priced = np.flatnonzero(horizon.price > 0)
        self._clarabel = clarabel()
        self._solver: Any = None
        self._A, self._b, self._cones = self._constraints()

    def solve(self, start: Array) -> Plan:
        """The best plan from a start (6,), m and m/s."""
        b = self._b.copy()
        b[:6] = (self._horizon.F[0] @ start + self._horizon.d[0]) / self._scale
        if self._solver is None:
            P, q = self._costs()
            self._solver = self._clarabel.DefaultSolver(P, q, self._A, b, self._cones, self._settings())
        else:
            self._solver.update(b=b)
        solution = self._solver.solve()
        x, n = np.asarray(solution.x), self._count
        status = self._clarabel.SolverStatus
        return Plan(
            cost_m_s=float(solution.obj_val) * self._unit_m_s,
            states=x[: 6 * n].reshape(n, 6) * self._scale,
            controls=x[6 * n : 9 * n].reshape(n, 3) * self._horizon.limit_m_s2,
            solved=solution.status in (status.Solved, status.AlmostSolved),
        )

    @property
    def _unit_m_s(self) -> float:
        """Unit of the cost: a second's full thrust, times the mean block."""
        return float(self._horizon.limit_m_s2 * self._horizon.duration_s.mean())

    def _costs(self) -> tuple[sparse.csc_matrix, Array]:
        """Quadratic part P and linear part q of the cost."""
        h, n, priced = self._horizon, self._count, self._priced
        price = h.price[priced] * self._length_m / self._unit_m_s
        thrust = h.duration_s / h.duration_s.mean()
        if h.steepness_per_m is None:
            P, errors = np.zeros(10 * n + len(priced)), price
        else:
            P = np.concatenate([np.zeros(10 * n), 2 * price * h.steepness_per_m * self._length_m])
            errors = np.zeros(len(priced))
        return sparse.diags(P).tocsc(), np.concatenate([np.zeros(9 * n), thrust, errors])

    def _constraints(self) -> tuple[sparse.csc_matrix, Array, list[Any]]:
        """A, b and cones of A z + slack = b, slack in the cones; z has states, accelerations, t and s."""
        parts = [self._dynamics(), self._limits(), self._thrust_cones(), self._error_cones()]
        A = sparse.vstack([matrix for matrix, _ in parts]).tocsc()
        n = self._count
        cones = [self._clarabel.ZeroConeT(6 * n), self._clarabel.NonnegativeConeT(6 * n)]
        cones += [self._clarabel.SecondOrderConeT(5)] * (n + len(self._priced))
        return A, np.concatenate([b for _, b in parts]), cones

    def _dynamics(self) -> tuple[sparse.csc_matrix, Array]:
        """x_(j+1) - F_j x_j - G_j u_j = d_j, in the program's units."""
        h, n, scale = self._horizon, self._count, self._scale
        F, G = h.F * scale / scale[:, None], h.G * h.limit_m_s2 / scale[:, None]
        along = np.arange(n)
        # F of the first block acts on the start, which stands on the right-hand side
        past = sparse.bsr_array((F[1:], along[: n - 1], np.concatenate([[0], along])), shape=(6 * n, 6 * n))
        push = sparse.bsr_array((G, along, np.arange(n + 1)), shape=(6 * n, 3 * n))
        rest = sparse.csc_array((6 * n, n + len(self._priced)))
        return sparse.hstack([sparse.eye_array(6 * n) - past, -push, rest]), (h.d / scale).ravel()

    def _limits(self) -> tuple[sparse.csc_matrix, Array]:
        """Of u along each axis, in units of the limit: u <= 1 and -u <= 1."""
        n = self._count
        both = sparse.vstack([sparse.eye_array(3 * n), -sparse.eye_array(3 * n)])
        rest = sparse.csc_array((6 * n, n + len(self._priced)))
        return sparse.hstack([sparse.csc_array((6 * n, 6 * n)), both, rest]), np.ones(6 * n)

    def _thrust_cones(self) -> tuple[sparse.csc_matrix, Array]:
        """(t_j, u_j, sigma_j) in the cone."""
        n, along = self._count, np.arange(self._count)
        rows = np.concatenate([5 * along, (5 * along[:, None] + [1, 2, 3]).ravel()])
        columns = np.concatenate([9 * n + along, 6 * n + np.arange(3 * n)])
        shape = (5 * n, 10 * n + len(self._priced))
        b = np.zeros((n, 5))
        b[:, 4] = self._horizon.thrust_scatter_m_s2 / self._horizon.limit_m_s2
        return sparse.csc_array((np.full(4 * n, -1.0), (rows, columns)), shape=shape), b.ravel()

    def _error_cones(self) -> tuple[sparse.csc_matrix, Array]:
        """(s_j, x_j - r_j, rho_j) in the cone."""
        n, priced = self._count, self._priced
        k = np.arange(len(priced))
        rows = np.concatenate([5 * k, (5 * k[:, None] + [1, 2, 3]).ravel()])
        columns = np.concatenate([10 * n + k, (6 * priced[:, None] + [0, 1, 2]).ravel()])
        matrix = sparse.csc_array((np.full(len(rows), -1.0), (rows, columns)), shape=(5 * len(k), 10 * n + len(k)))
        b = np.zeros((len(k), 5))
        b[:, 1:4] = -self._horizon.place_m[priced] / self._length_m
        b[:, 4] = self._horizon.error_scatter_m[priced] / self._length_m
        return matrix, b.ravel()

    def _settings(self) -> Any:
        settings = self._clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False  # a presolved program takes no new right-hand side
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        return settings


def clarabel() -> ModuleType:
    """The solver, of the extra `optimal`.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    try:
        import clarabel
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("mpc needs Clarabel: pip install 'formation-env[optimal]'") from error
    return clarabel
