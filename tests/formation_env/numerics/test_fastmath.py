"""The vectorisable elementary functions, against numpy's."""

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.numerics import fastmath

Array = NDArray[np.float64]


@numba.njit
def bits_and_back(x: Array) -> tuple[NDArray[np.uint64], Array]:
    out = np.empty((len(x), 2))
    words = np.empty(len(x), np.uint64)
    for i in range(len(x)):
        words[i] = fastmath.to_bits(x[i])
        out[i] = fastmath.from_bits(words[i]), fastmath.from_integer(fastmath.to_integer(x[i]))
    return words, out


def test_bits_are_ieee_754() -> None:
    """The words are numpy's view of the same floats, and lead back to them."""
    x = np.array([0.0, 1.0, 2.5, 3.5, 1e15, 2.0**52 - 1])
    words, back = bits_and_back(x)
    np.testing.assert_array_equal(words, x.view(np.uint64))
    np.testing.assert_array_equal(back[:, 0], x)
    # Ties go to even, as numpy's do.
    np.testing.assert_array_equal(back[:, 1], np.rint(x))
