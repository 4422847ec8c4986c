"""Second-order cone programs, solved by Clarabel (Goulart & Chen 2024, arXiv 2405.12762)."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from formation_env.numerics.arrays import Array

SOLVER: Final = "clarabel"
"""Name of the library that solves cone programs, of the extra `optimal`."""
EXACT: Final = 1e-9
"""Relative tolerance of residuals and duality gap where the solution is certified."""


class SolverError(RuntimeError):
    """The solver ended without a solution; the message has its status."""


class UnreachableError(ValueError):
    """No point meets all constraints."""


@dataclass(frozen=True)
class Cones:
    """The cones of a program's rows, in order.

    Attributes:
        zero: number of first rows with s = 0.
        positive: number of next rows with s >= 0.
        vectors: number of second-order cones, in which the first row is at least the length of the others.
        size: rows of each of them.
    """

    zero: int
    positive: int
    vectors: int
    size: int = 4


@dataclass(frozen=True)
class ConeSolution:
    """The solver's best point.

    Attributes:
        x: variables.
        z: multipliers of the rows.
        cost: value of the primal objective.
        status: the solver's own word for how it ended, such as `Solved` or `InsufficientProgress`.
    """

    x: Array
    z: Array
    cost: float
    status: str

    @property
    def solved(self) -> bool:
        """Whether the tolerance was reached, or nearly so."""
        return self.status in ("Solved", "AlmostSolved")

    def checked(self, task: str) -> "ConeSolution":
        """The solution itself.

        Args:
            task: what was asked, for the message.

        Raises:
            SolverError: the solver failed.
        """
        if not self.solved:
            raise SolverError(f"{task}: the cone solver ended with status {self.status}")
        return self


class ConeSolver:
    """Minimise x'Px / 2 + q'x so that A x + s = b with s in the cones; laid out once, solved for any number of b."""

    def __init__(self, P: Any, q: ArrayLike, A: Any, cones: Cones, *, tolerance: float = EXACT) -> None:
        """Keep the matrices.

        Args:
            P: sparse columns (variables, variables), positive semidefinite.
            q: (variables,).
            A: sparse columns (rows, variables).
            cones: of the rows.
            tolerance: relative, of residuals and duality gap.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        self._library = clarabel()
        self._P, self._q, self._A, self._cones = P, np.asarray(q), A, cones
        self._tolerance = tolerance
        self._solver: Any = None

    def solve(self, b: ArrayLike) -> ConeSolution:
        """Solve for a right-hand side (rows,).

        Raises:
            UnreachableError: no point meets all constraints.
        """
        if self._solver is None:
            self._solver = self._library.DefaultSolver(
                self._P, self._q, self._A, np.asarray(b), self._shapes(), self._settings()
            )
        else:
            self._solver.update(b=np.asarray(b))
        result = self._solver.solve()
        status = str(result.status)
        if "PrimalInfeasible" in status:
            raise UnreachableError("no point meets all constraints")
        return ConeSolution(np.array(result.x), np.array(result.z), float(result.obj_val), status)

    def _shapes(self) -> list[Any]:
        library, cones = self._library, self._cones
        shapes = [library.ZeroConeT(cones.zero), library.NonnegativeConeT(cones.positive)]
        return shapes + [library.SecondOrderConeT(cones.size)] * cones.vectors

    def _settings(self) -> Any:
        settings = self._library.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False  # a presolved program takes no new right-hand side
        settings.max_threads = 1  # workers share the cores
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = self._tolerance
        return settings


def clarabel() -> ModuleType:
    """Import the solver.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    try:
        import clarabel
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "cone programs (mpc, lqr_nominal, fuel_optimal) need Clarabel: pip install 'formation-env[optimal]'",
            name=SOLVER,
        ) from error
    library: ModuleType = clarabel
    return library
