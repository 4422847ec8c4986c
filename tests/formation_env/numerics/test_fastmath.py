"""The vectorisable elementary functions, against numpy's."""

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from formation_env.numerics import fastmath

Array = NDArray[np.float64]
TOLERANCE = 1e-9
"""They promise 2e-10; noise and float32 observations show nothing below 1e-8."""


@numba.njit
def logs(x: Array) -> Array:
    out = np.empty_like(x)
    for i in range(len(x)):
        out[i] = fastmath.log(x[i])
    return out


@numba.njit
def cosines_sines(turns: Array) -> Array:
    out = np.empty((len(turns), 2))
    for i in range(len(turns)):
        out[i] = fastmath.cos_sin_turns(turns[i])
    return out


@numba.njit
def bits_and_back(x: Array) -> tuple[NDArray[np.uint64], Array]:
    out = np.empty((len(x), 2))
    words = np.empty(len(x), np.uint64)
    for i in range(len(x)):
        words[i] = fastmath.to_bits(x[i])
        out[i] = fastmath.from_bits(words[i]), fastmath.from_integer(fastmath.to_integer(x[i]))
    return words, out


@pytest.mark.parametrize(
    "x",
    [
        np.logspace(-307, 308, 20001),
        np.random.default_rng(1).random(100_000) + 2.0**-33,
        1 + np.linspace(-1e-3, 1e-3, 20001),
        1 + np.array([-1.0, 1.0])[:, None] * 2.0 ** -np.arange(1.0, 53.0),
        np.sqrt(2) * (1 + np.linspace(-1e-15, 1e-15, 21)),
    ],
    ids=["all magnitudes", "uniforms", "around 1", "towards 1", "around the seam"],
)
def test_log(x: Array) -> None:
    """Relative to the logarithm itself, also where it goes to 0; exactly 0 at 1."""
    np.testing.assert_allclose(logs(x.ravel()), np.log(x.ravel()), rtol=TOLERANCE, atol=0)
    assert logs(np.ones(1))[0] == 0


def test_cos_sin_turns() -> None:
    """Over one whole turn, relative to the unit circle."""
    turns = np.concatenate([np.linspace(0, 1, 40001), np.random.default_rng(2).random(100_000)])
    angles = 2 * np.pi * turns
    expected = np.column_stack([np.cos(angles), np.sin(angles)])
    np.testing.assert_allclose(cosines_sines(turns), expected, rtol=0, atol=TOLERANCE)


def test_cos_sin_turns_at_the_seams() -> None:
    """Exact at quarter turns, and continuous at the eighths where the polynomials change."""
    np.testing.assert_array_equal(cosines_sines(np.linspace(0, 1, 5)), [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0]])
    eighths = np.arange(1, 8, 2) / 8
    below, above = cosines_sines(np.nextafter(eighths, 0)), cosines_sines(np.nextafter(eighths, 1))
    np.testing.assert_allclose(below, above, rtol=0, atol=TOLERANCE)


def test_bits_are_ieee_754() -> None:
    """The words are numpy's view of the same floats, and lead back to them."""
    x = np.array([0.0, 1.0, 2.5, 3.5, 1e15, 2.0**52 - 1])
    words, back = bits_and_back(x)
    np.testing.assert_array_equal(words, x.view(np.uint64))
    np.testing.assert_array_equal(back[:, 0], x)
    # Ties go to even, as numpy's do.
    np.testing.assert_array_equal(back[:, 1], np.rint(x))
