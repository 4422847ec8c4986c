"""Copies between rows that lie one after the other and fields that lie one after the other.

Eight rows of eight numbers are loaded as vectors, transposed in registers and stored: several times as fast as number
by number.
"""

from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

BLOCK: Final = 8
"""Rows and columns of a block."""


def _shuffle(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    mask = ir.Constant(ir.VectorType(ir.IntType(32), BLOCK), lanes)
    return builder.shuffle_vector(a, b, mask)


def _transpose(builder: Any, rows: list[Any]) -> list[Any]:
    """Exchange the off-diagonal halves of ever smaller blocks."""
    for half in (4, 2, 1):
        for i in range(BLOCK):
            if not i & half:
                a, b = rows[i], rows[i + half]
                upper = [j if not j & half else BLOCK + j - half for j in range(BLOCK)]
                lower = [j + half if not j & half else BLOCK + j for j in range(BLOCK)]
                rows[i], rows[i + half] = _shuffle(builder, a, b, upper), _shuffle(builder, a, b, lower)
    return rows


@intrinsic
def _transpose_block(typing_context: Any, source: Any, starts: Any, target: Any, places: Any) -> Any:
    """The type of `transpose_block`, and how its code is generated."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(context.get_value_type(source.dtype), BLOCK).as_pointer()

        def pointers(array: int) -> list[Any]:
            data = context.make_array(signature.args[array])(context, builder, arguments[array]).data
            offsets = [builder.extract_value(arguments[array + 1], k) for k in range(BLOCK)]
            return [builder.bitcast(builder.gep(data, [offset]), vector) for offset in offsets]

        alignment = source.dtype.bitwidth // 8
        rows = [builder.load(pointer, align=alignment) for pointer in pointers(0)]
        for row, pointer in zip(_transpose(builder, rows), pointers(2), strict=True):
            builder.store(row, pointer, align=alignment)
        return context.get_dummy_value()

    return types.void(source, starts, target, places), generate


transpose_block: Any = _transpose_block
"""transpose_block(source, starts, target, places): copy eight rows of eight numbers as eight columns.

Number j of the row that begins at starts[k] goes to target[places[j] + k]. The arrays are contiguous and of one type;
starts and places are tuples of eight offsets into them.
"""
