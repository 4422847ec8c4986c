"""Large arrays read and written in one sweep, past the limits of the processor's caches."""

from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LINE_BYTES: Final = 64
"""Bytes that memory and cache exchange at once."""


def _pointer(context: Any, builder: Any, signature: Any, arguments: Any, array: int, to: Any) -> Any:
    """Pointer to the element of an argument that the next argument counts."""
    data = context.make_array(signature.args[array])(context, builder, arguments[array]).data
    return builder.bitcast(builder.gep(data, [arguments[array + 1]]), to.as_pointer())


@intrinsic
def _read_ahead(typing_context: Any, array: Any, place: Any) -> Any:
    """The type of `read_ahead`, and how its code is generated."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(32)
        value = builder.load(_pointer(context, builder, signature, arguments, 0, word), align=4)
        # An empty instruction that takes the value, so that the load is not left out.
        builder.asm(ir.FunctionType(ir.VoidType(), [word]), "", "r", [value], side_effect=True)
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


@intrinsic
def _write_line(typing_context: Any, source: Any, begin: Any, target: Any, place: Any) -> Any:
    """The type of `write_line`, and how its code is generated."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        size = source.dtype.bitwidth // 8
        line = ir.VectorType(context.get_value_type(source.dtype), LINE_BYTES // size)
        values = builder.load(_pointer(context, builder, signature, arguments, 0, line), align=size)
        stored = builder.store(values, _pointer(context, builder, signature, arguments, 2, line), align=LINE_BYTES)
        stored.set_metadata("nontemporal", builder.module.add_metadata([ir.IntType(32)(1)]))
        return context.get_dummy_value()

    return types.void(source, types.intp, target, types.intp), generate


read_ahead: Any = _read_ahead
"""read_ahead(array, place): bring element `place` of a flat array into the cache; in order, the next ones follow."""
write_line: Any = _write_line
"""write_line(source, begin, target, place): copy LINE_BYTES from one flat array to another of its type.

The target's place is at a multiple of LINE_BYTES. The line goes to memory without being read into the cache first.
"""
