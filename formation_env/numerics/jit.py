"""How the compiled functions of the project are made.

An inlined scalar function works on one row's scalars. It is inlined where it is called, so that a loop over the rows of
a tile has a body of scalars only, which the compiler turns into vector instructions.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
from numba.extending import intrinsic, register_jitable

F = TypeVar("F", bound=Callable[..., Any])

LANES: Final = 32
"""Rows of one tile: a compile-time constant, a multiple of every vector width."""

# Strict IEEE arithmetic, fused multiply-adds only where `fma` is written: a row's results are the same bits in a vector
# and alone.
FAST_MATH: Final = False


_ARITHMETIC: Final[dict[str, Any]] = {"fastmath": FAST_MATH, "error_model": "numpy"}
# Only compiled code calls these, so they need no way in from Python or C, which saves a quarter of the compile time.
_INNER: Final[dict[str, Any]] = {**_ARITHMETIC, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def inline_scalar(function: F) -> F:
    """Compile a function of scalars to be inlined into its callers."""
    return cast(F, numba.njit(**_INNER, forceinline=True)(function))


def tile_function(function: F) -> F:
    """Compile a function that runs a few inlined scalar functions over the rows of a tile."""
    return cast(F, numba.njit(**_INNER)(function))


def python_and_compiled(function: F) -> F:
    """Leave a function of scalars or arrays to Python as it is, and inline it where compiled code calls it."""
    wrapped: F = register_jitable(**_ARITHMETIC, forceinline=True)(function)
    return wrapped


def compiled_loop(function: F) -> F:
    """Compile a loop over arrays that Python calls; kept on disk."""
    return cast(F, numba.njit(**_ARITHMETIC, cache=True)(function))


def _spaced(typing_context: Any, values: Any, first: Any, step: Any, count: Any) -> Any:
    """The type of `spaced`, and how its code is generated."""
    if not isinstance(count, numba.types.IntegerLiteral):
        raise numba.errors.RequireLiteralValue("spaced: count must be a constant")
    size = count.literal_value
    result = numba.types.UniTuple(values.dtype, size)  # type: ignore[no-untyped-call]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        places = [builder.add(arguments[1], builder.mul(arguments[2], arguments[2].type(k))) for k in range(size)]
        loads = [context.unpack_value(builder, values.dtype, builder.gep(array.data, [place])) for place in places]
        return context.make_tuple(builder, result, loads)

    return result(values, numba.types.intp, numba.types.intp, count), generate


spaced: Any = intrinsic(_spaced)
"""spaced(array, first, step, count): numbers of a contiguous array (n,) as a tuple; how many is a constant.

Each is a load of its own, which the compiler drops if nobody needs it, and turns into vector loads if a loop over rows
is around it; with slices it does neither.
"""
