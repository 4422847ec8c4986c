"""The vectorisable functions of single-precision numbers, against numpy's of double."""

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from formation_env.numerics import single_precision

Array32 = NDArray[np.float32]


@numba.njit
def logs(x: Array32) -> Array32:
    out = np.empty_like(x)
    for i in range(len(x)):
        out[i] = single_precision.log(x[i])
    return out


@numba.njit
def cosines_sines(angles: Array32) -> Array32:
    out = np.empty((len(angles), 2), np.float32)
    for i in range(len(angles)):
        out[i, 0], out[i, 1] = single_precision.cos_sin(angles[i])
    return out


@pytest.mark.parametrize(
    "x",
    [
        np.logspace(-37, 38, 20001),
        np.random.default_rng(1).random(100_000) + 2.0**-24,
        1 + np.linspace(-1e-3, 1e-3, 20001),
        1 + np.array([-1.0, 1.0])[:, None] * 2.0 ** -np.arange(1.0, 23.0),
        np.sqrt(2) * (1 + np.linspace(-1e-6, 1e-6, 21)),
    ],
    ids=["all magnitudes", "uniforms", "around 1", "towards 1", "around the seam"],
)
def test_log(x: NDArray[np.float64]) -> None:
    """To 1e-6 of the logarithm itself, also where it goes to 0; exactly 0 at 1."""
    single = x.ravel().astype(np.float32)
    expected = np.log(single.astype(float))
    np.testing.assert_allclose(logs(single), expected, rtol=1e-6, atol=0)
    assert logs(np.ones(1, np.float32))[0] == 0


def test_cos_sin() -> None:
    """Over the half circle, to four roundings of the unit circle (2.4e-7)."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 100_001).astype(np.float32)
    wide = angles.astype(float)
    expected = np.column_stack([np.cos(wide), np.sin(wide)])
    np.testing.assert_allclose(cosines_sines(angles), expected, rtol=0, atol=2.0**-22)
    np.testing.assert_array_equal(cosines_sines(np.zeros(1, np.float32)), [[1, 0]])
