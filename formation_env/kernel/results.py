"""What a step or a reset tells, in blocks that the compiled program writes once."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages.memory import Flags, Integers
from formation_env.kernel.tile import (
    FLAGS,
    INTEGERS,
    NOISES,
    NUM_NOISES,
    NUM_RESULTS,
    RESULTS,
    Noises,
    Results,
)
from formation_env.numerics.arrays import Array

NO_NOISES: Final = np.empty((0, 0))
_PADDING: Final = 8
"""Columns behind the rows, so that the fields of a block do not fall on the same lines of the processor's cache."""
_RESULT_SPANS: Final = {name: (getattr(RESULTS, name), size) for name, size in Results()._asdict().items()}
RESULT_NAMES: Final = (*Results._fields, *FLAGS._fields, *INTEGERS._fields)
_NOISE_SPANS: Final = {name: (getattr(NOISES, name), size) for name, size in Noises()._asdict().items()}


class StepResults:
    """What a step or a reset tells of all rows; blocks (fields, rows or more), one allocation each.

    Attributes:
        values: fields `tile.RESULTS`.
        flags: fields `tile.FLAGS`.
        integers: fields `tile.INTEGERS`.
        noises: fields `tile.NOISES`, or none if nobody asks.
        num_rows: rows.
    """

    __slots__ = ("flags", "integers", "noises", "num_rows", "values")

    def __init__(self, values: Array, flags: Flags, integers: Integers, noises: Array, num_rows: int) -> None:
        self.values = values
        self.flags = flags
        self.integers = integers
        self.noises = noises
        self.num_rows = num_rows

    @classmethod
    def zeros(cls, num_rows: int, with_noises: bool) -> "StepResults":
        """Blocks of zeros."""
        pitch = num_rows + _PADDING if num_rows > 1 else 1
        noises = np.zeros((NUM_NOISES, pitch)) if with_noises else NO_NOISES
        flags, integers = np.zeros((len(FLAGS), pitch), np.bool_), np.zeros((len(INTEGERS), pitch), np.int64)
        return cls(np.zeros((NUM_RESULTS, pitch)), flags, integers, noises, num_rows)

    def copy(self) -> "StepResults":
        """The same values, of nobody else."""
        blocks = (self.values.copy(), self.flags.copy(), self.integers.copy(), self.noises.copy())
        return StepResults(*blocks, self.num_rows)

    def only(self, rows: NDArray[np.intp]) -> "StepResults":
        """The values of some rows in their places, zero elsewhere."""
        part = StepResults.zeros(self.num_rows, len(self.noises) > 0)
        for mine, whole in zip(part.blocks, self.blocks, strict=True):
            if len(mine):
                mine[:, rows] = whole[:, rows]
        return part

    @property
    def blocks(self) -> tuple[NDArray[Any], ...]:
        """All blocks."""
        return self.values, self.flags, self.integers, self.noises

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A field by name, a view (rows,) or (rows, size)."""
        if name in _RESULT_SPANS:
            return _field(self.values, _RESULT_SPANS[name], self.num_rows)
        if name in FLAGS._fields:
            return self.flags[getattr(FLAGS, name), : self.num_rows]
        if name in INTEGERS._fields:
            return self.integers[getattr(INTEGERS, name), : self.num_rows]
        return _field(self.noises, _NOISE_SPANS[name], self.num_rows)


def _field(block: Array, span: tuple[int, int], num_rows: int) -> Array:
    first, size = span
    return block[first, :num_rows] if size == 1 else block[first : first + size, :num_rows].T
