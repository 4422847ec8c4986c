"""What a step or a reset tells, in blocks that the compiled program writes once."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.reused_arrays import Arrays, Shape
from formation_env.kernel.tile import Flags, Integers, Noises, Results, Safety

_PADDING: Final = 8
"""Least columns behind the rows, so that the fields of a block do not fall on the same lines of the processor's cache,
and a number of which all columns are a multiple, so that each field begins a line."""
_BLOCKS: Final[tuple[tuple[Any, Any], ...]] = (
    (Results(), np.float64),
    (Flags(), np.bool_),
    (Integers(), np.int64),
    (Safety(), np.float64),
    (Noises(), np.float64),
)
_ALWAYS: Final = 3
"""Blocks that every simulation has."""


def _places() -> dict[str, tuple[int, int | slice]]:
    """The block of each field, and its place in it."""
    places: dict[str, tuple[int, int | slice]] = {}
    for block, (sizes, _) in enumerate(_BLOCKS):
        first = 0
        for name, size in sizes._asdict().items():
            places[name] = block, first if size == 1 else slice(first, first + size)
            first += size
    return places


PLACES: Final = _places()
"""The block of each named result, and its fields there."""
RESULT_NAMES: Final = tuple(name for name, (block, _) in PLACES.items() if _BLOCKS[block][0] != Noises())


def block_shapes(num_rows: int, guarded: bool, with_noises: bool) -> tuple[Shape, ...]:
    """Shapes and types of the blocks of `tile.Results`, `Flags`, `Integers`, `Safety` and `Noises`.

    Args:
        num_rows: rows; each block is (fields, num_rows) or somewhat wider.
        guarded: whether the scenario limits anything; if not, `Safety` has no fields.
        with_noises: whether the step's noises are asked for; if not, `Noises` has no fields.
    """
    pitch = (num_rows + 2 * _PADDING - 1) // _PADDING * _PADDING if num_rows > 1 else 1
    kept = (*(True for _ in range(_ALWAYS)), guarded, with_noises)
    return tuple(((sum(sizes) * each, pitch), dtype) for (sizes, dtype), each in zip(_BLOCKS, kept, strict=True))


class StepResults:
    """What a step or a reset tells of all rows.

    Attributes:
        blocks: of `block_shapes`.
        num_rows: rows.
    """

    __slots__ = ("blocks", "num_rows")

    def __init__(self, blocks: Arrays, num_rows: int) -> None:
        """Take blocks of `block_shapes`."""
        self.blocks = blocks
        self.num_rows = num_rows

    @classmethod
    def zeros(cls, num_rows: int, shapes: tuple[Shape, ...]) -> "StepResults":
        """Zero everywhere, in blocks of these shapes."""
        return cls(tuple(np.zeros(*shape) for shape in shapes), num_rows)

    def copy(self) -> "StepResults":
        """The same values, of nobody else."""
        return StepResults(tuple(block.copy() for block in self.blocks), self.num_rows)

    def only(self, rows: NDArray[np.intp], blocks: Arrays) -> "StepResults":
        """The values of some rows, in blocks that are zero elsewhere."""
        for mine, whole in zip(blocks, self.blocks, strict=True):
            mine[:, rows] = whole[:, rows]
        return StepResults(blocks, self.num_rows)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A field by name, a view (rows,) or (rows, size)."""
        block, place = PLACES[name]
        return self.blocks[block][place, : self.num_rows].T
