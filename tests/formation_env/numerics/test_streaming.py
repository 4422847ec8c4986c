"""Copies past the cache copy what they say, and nothing else."""

import numba
import numpy as np
import pytest

from formation_env.numerics.streaming import LINE_BYTES, read_ahead, write_line


@numba.njit
def copy_line(source: np.ndarray, begin: int, target: np.ndarray, place: int) -> None:
    """Read ahead, and copy a line."""
    read_ahead(source, begin)
    write_line(source, begin, target, place)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_line_is_copied(dtype: type) -> None:
    """From any place to an aligned one; the numbers beside it stay."""
    source = np.arange(100, dtype=dtype)
    count = LINE_BYTES // source.itemsize
    whole = np.full(8 * count, -1, dtype)
    target = whole[-whole.ctypes.data % LINE_BYTES // whole.itemsize :]
    copy_line(source, 3, target, 2 * count)
    expected = np.full_like(target, -1)
    expected[2 * count : 3 * count] = source[3 : 3 + count]
    np.testing.assert_array_equal(target, expected)
