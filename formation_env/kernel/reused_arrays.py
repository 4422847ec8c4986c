"""Arrays that are written again once nobody else holds them.

Large arrays that are made anew at each step cost more than what is written into them: the system hands them over page
by page, cleared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from operator import le
from sys import getrefcount
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.streaming import LINE_BYTES

Arrays = tuple[NDArray[Any], ...]
Shape = tuple[tuple[int, ...], type]

LEAST_BYTES: Final = 1 << 17
"""Smaller arrays are made anew: the allocator keeps their memory at hand."""
MOST_KEPT: Final = 4


def _new(make: Callable[..., NDArray[Any]], shape: tuple[int, ...], dtype: type) -> NDArray[Any]:
    """A new array that begins at a multiple of LINE_BYTES."""
    size = prod(shape)
    owner = make(size + LINE_BYTES // np.dtype(dtype).itemsize, dtype)
    first = -owner.ctypes.data % LINE_BYTES // owner.itemsize
    return owner[first : first + size].reshape(shape)


def _held(arrays: Arrays) -> tuple[int, int]:
    """The most references that any of some arrays has, and any owner of their memory, which each view of it holds."""
    return max(map(getrefcount, arrays)), max([getrefcount(array.base) for array in arrays])


_HELD_BY_NOBODY: Final = _held((_new(np.empty, (1,), float),))
_NO_ROWS: Final = np.empty(0, np.intp)


@dataclass
class _Kept:
    arrays: Arrays
    written: NDArray[np.intp]  # rows that are not zero


class ReusedArrays:
    """Gives out arrays of the same shapes, uninitialised; those that have been dropped once more."""

    _make: Callable[..., NDArray[Any]] = staticmethod(np.empty)

    def __init__(self, shapes: Sequence[Shape]) -> None:
        """Take shape and type of each array."""
        self._shapes = tuple(shapes)
        self._kept: list[_Kept] = []
        self._is_kept = False
        self._is_kept = max(array.nbytes for array in self.take()) >= LEAST_BYTES

    def take(self) -> Arrays:
        """Arrays that nobody else holds."""
        return self._take().arrays

    def _take(self) -> _Kept:
        for kept in self._kept:
            if all(map(le, _held(kept.arrays), _HELD_BY_NOBODY)):
                return kept
        make = partial(_new, self._make) if self._is_kept else self._make
        made = _Kept(tuple([make(shape, dtype) for shape, dtype in self._shapes]), _NO_ROWS)
        if self._is_kept:
            self._kept = [made, *self._kept[: MOST_KEPT - 1]]
        return made


class ReusedZeros(ReusedArrays):
    """Gives out arrays (fields, rows) of zeros; the rows that were written are cleared before the next use."""

    _make = staticmethod(np.zeros)

    def take_for(self, rows: NDArray[np.intp]) -> Arrays:
        """Arrays that nobody else holds, zero everywhere, of which only some rows may be written."""
        kept = self._take()
        if len(kept.written):
            for array in kept.arrays:
                array[:, kept.written] = 0
        kept.written = rows
        return kept.arrays
