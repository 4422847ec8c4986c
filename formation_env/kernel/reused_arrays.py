"""Arrays that are written again once nobody else holds them.

Large arrays that are made anew at each step cost more than what is written into them: the system hands them over page
by page, cleared.
"""

from collections.abc import Sequence
from sys import getrefcount
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Arrays = tuple[NDArray[Any], ...]
Shape = tuple[tuple[int, ...], type]

LEAST_BYTES: Final = 1 << 17
"""Smaller arrays are made anew: the allocator keeps their memory at hand."""
MOST_KEPT: Final = 4


def _held(arrays: Arrays) -> int:
    """The most references that any of some arrays has; views count, since each holds the array that owns its memory."""
    return max(map(getrefcount, arrays))


_HELD_BY_NOBODY: Final = _held((np.empty(1),))


class ReusedArrays:
    """Gives out arrays of the same shapes, uninitialised; those that have been dropped once more."""

    def __init__(self, shapes: Sequence[Shape]) -> None:
        """Take shape and type of each array."""
        self._shapes = tuple(shapes)
        self._is_kept = max(array.nbytes for array in self._new()) >= LEAST_BYTES
        self._kept: list[Arrays] = []

    def _new(self) -> Arrays:
        return tuple([np.empty(shape, dtype) for shape, dtype in self._shapes])

    def take(self) -> Arrays:
        """Arrays that nobody else holds."""
        if not self._is_kept:
            return self._new()
        for arrays in self._kept:
            if _held(arrays) <= _HELD_BY_NOBODY:
                return arrays
        arrays = self._new()
        self._kept = [arrays, *self._kept[: MOST_KEPT - 1]]
        return arrays
