"""Copies of blocks between lines and fields, against numpy's transpose."""

from typing import Any

import numba
import numpy as np
import pytest

from formation_env.numerics.transpose import BLOCK, transpose_block


@numba.njit
def transposed(source: Any, starts: Any, target: Any, places: Any) -> None:
    transpose_block(source, starts, target, places)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_block_is_transposed_wherever_it_lies(dtype: type) -> None:
    """Rows in any order and at any distance; nothing but the eight columns is written."""
    source = np.arange(400, dtype=dtype)
    starts = (300, 3, 91, 17, 200, 111, 388, 64)
    places = (5, 20, 40, 300, 100, 77, 150, 255)
    target = np.full(400, -1, dtype)
    expected = target.copy()
    for j, place in enumerate(places):
        for k, start in enumerate(starts):
            expected[place + k] = source[start + j]
    transposed(source, starts, target, places)
    np.testing.assert_array_equal(target, expected)
    assert (target >= 0).sum() == BLOCK**2
