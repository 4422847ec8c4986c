"""Second-order cone programs for Clarabel (Goulart & Chen 2024, arXiv 2405.12762)."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from formation_env.numerics.arrays import Array

TOLERANCE: Final = 1e-9
"""Relative, of the solver's residuals and its gap."""


class UnreachableError(ValueError):
    """No point meets all constraints."""


def solve_cones(
    P: Any, q: ArrayLike, A: Any, b: ArrayLike, zero: int, positive: int, vectors: int
) -> tuple[Array, Array]:
    """Least x'Px / 2 + q'x with A x + s = b, s in the cones.

    Args:
        P: sparse columns (variables, variables), positive semidefinite.
        q: (variables,).
        A: sparse columns (rows, variables).
        b: (rows,).
        zero: rows, the first ones, with s = 0.
        positive: the next rows, with s >= 0.
        vectors: how many fours of rows follow, in which the first is at least the length of the others.

    Returns:
        The variables, and the multipliers of the rows. They are the solver's best, and for the caller to judge.

    Raises:
        UnreachableError: no point meets all constraints.
        ModuleNotFoundError: Clarabel is not installed.
    """
    try:
        import clarabel
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("the fuel optimum needs Clarabel: pip install 'formation-env[optimal]'") from error

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    cones = [clarabel.ZeroConeT(zero), clarabel.NonnegativeConeT(positive)]
    cones += [clarabel.SecondOrderConeT(4)] * vectors
    result = clarabel.DefaultSolver(P, np.asarray(q), A, np.asarray(b), cones, settings).solve()
    if "PrimalInfeasible" in str(result.status):
        raise UnreachableError("no point meets all constraints")
    return np.array(result.x), np.array(result.z)
