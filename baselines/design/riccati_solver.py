"""Algebraic Riccati equations on any processor: other units where the solver gives up, and one clear error.

Legend: Q, R weights of state and control.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.linalg import LinAlgWarning

from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError

T = TypeVar("T")

UNIT_FACTORS: Final = (1.0, 4.0, 0.25, 32.0, 1 / 32, 256.0, 1 / 256)
"""Units in which a Riccati solver is asked, one after the other; powers of two, so that scaling does not round."""


def in_some_units(solve: Callable[[float], T], failure: str) -> T:
    """The first result of a Riccati solver that does not give up, in units of time that differ by the factor given.

    Whether scipy's reordering of eigenvalues succeeds in given units depends on how the processor rounds.

    Raises:
        ConfigError: the solver fails in all units; the message is the failure's.
    """
    for factor in UNIT_FACTORS:
        with suppress(np.linalg.LinAlgError, LinAlgWarning, ValueError), catch_warnings():
            simplefilter("error", LinAlgWarning)
            return solve(factor)
    raise ConfigError(failure)


def check_state_weights(Q: Array) -> None:
    """Refuse weights (6, 6) by which no state costs anything."""
    if not np.any(Q):
        raise ConfigError("weights: position and velocity_s2 are all 0, so no error costs anything; one must be > 0")


def no_regulator(Q: Array, R: Array) -> str:
    """The one line for weights by which no gain of an infinite horizon exists."""
    position, velocity, control_ = (np.diag(part).tolist() for part in (Q[:3, :3], Q[3:, 3:], R))
    return (
        f"weights: position {position} and velocity_s2 {velocity} with control weights {control_} s^4 give no stable "
        "regulator; a motion that does not fade by itself must cost something: set position weights > 0"
    )
