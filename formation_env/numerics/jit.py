"""Decorators of the project's compiled functions, and their cache on disk.

An inlined scalar function works on one row's scalars. It is inlined where it is called, so that a loop over the rows of
a tile has a body of scalars only, which the compiler turns into vector instructions.
"""

import inspect
import warnings
from collections.abc import Callable, Hashable, Mapping
from typing import Any, Final, TypeVar, cast

import numba
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic, register_jitable

from formation_env.numerics.inner_functions import InnerCompiler

F = TypeVar("F", bound=Callable[..., Any])

LANES: Final = 64
"""Rows of one tile: a compile-time constant, a multiple of every vector width."""

# Strict IEEE arithmetic, fused multiply-adds only where `fma` is written: a row's results are the same bits in a vector
# and alone.
FAST_MATH: Final = False


_ARITHMETIC: Final[dict[str, Any]] = {"fastmath": FAST_MATH, "error_model": "numpy"}
# Only compiled code calls these, so they need no way in from Python or C, and no machine code of their own.
_INNER: Final[dict[str, Any]] = {
    **_ARITHMETIC,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": InnerCompiler,
}


def inline_scalar(function: F) -> F:
    """Compile a function of scalars to be inlined into its callers."""
    return cast(F, numba.njit(**_INNER, forceinline=True)(function))


def tile_function(function: F) -> F:
    """Compile a function that runs a few inlined scalar functions over the rows of a tile."""
    return cast(F, numba.njit(**_INNER)(function))


@inline_scalar
def whole_vectors(count: int) -> int:
    """A number of rows, up to whole vectors of any processor: fewer rows than a vector has are computed one by one."""
    return (count + 15) // 16 * 16


@inline_scalar
def turns(count: int, array: Any) -> int:
    """A number of turns of a loop over fields, such that the compiler does not know it and writes the loop once.

    Args:
        count: the number, a constant.
        array: any array that is longer.
    """
    return min(count, len(array))


def python_and_compiled(function: F) -> F:
    """Leave a function of scalars or arrays to Python as it is, and inline it where compiled code calls it."""
    wrapped: F = register_jitable(**_ARITHMETIC, forceinline=True)(function)
    return wrapped


def compiled_loop(function: F) -> F:
    """Compile a loop over arrays that Python calls, and cache it on disk where that is possible."""
    return _cached(function, None)


def compiled_program(*key: Hashable) -> Callable[[F], F]:
    """Compile a loop that is composed of the functions it closes over; other threads run meanwhile.

    Args:
        key: tells it from others of the same source in the cache on disk: what was chosen, and a hash of all sources.
    """
    return lambda function: _cached(function, key)


def entry_point(function: F, types: Mapping[str, Any]) -> F:
    """A compiled function for arguments of fixed types, which numba need not look at in each call.

    Whoever calls it vouches for them: strides that differ are not noticed.

    Args:
        function: of `compiled_program` or `compiled_loop`.
        types: numba's type of each argument, by its name; other names are left alone.
    """
    if not isinstance(function, Dispatcher):  # with NUMBA_DISABLE_JIT
        return function
    signature = tuple(types[name] for name in inspect.signature(function.py_func).parameters)
    function.compile(signature)
    return cast(F, function.get_overload(signature))


def _cached(function: F, key: tuple[Hashable, ...] | None) -> F:
    compiled = numba.njit(**_ARITHMETIC, nogil=True)(function)
    if isinstance(compiled, Dispatcher):  # not with NUMBA_DISABLE_JIT
        try:
            cast(Any, compiled)._cache = _Cache(function, key)
        except RuntimeError as error:  # numba found no folder that it may write to
            _warn_once(f"{error}; {_NO_CACHE}")
    return cast(F, compiled)


class _Cache(FunctionCache):
    """numba's cache of a function, which compiles anew where a file is damaged or cannot be written.

    numba itself passes on whatever goes wrong, at every later run too. It also tells functions apart by what they close
    over, where another function counts as new in each process; a key of our own says what was chosen.
    """

    def __init__(self, function: Callable[..., Any], key: tuple[Hashable, ...] | None) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._key = key

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        if self._key is None:
            return super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return sig, codegen.magic_tuple(), self._key

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled code for a signature, or None if there is none that can be used."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception as error:  # unpickling a damaged file may raise anything
            _warn_once(f"damaged cache {self.cache_path}: {type(error).__name__}: {error}; the code is compiled anew")
            self._write(self.flush)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save compiled code for a signature, if the disk takes it."""
        self._write(lambda: FunctionCache.save_overload(self, sig, data))  # type: ignore[no-untyped-call]

    def _write(self, save: Callable[[], Any]) -> None:
        try:
            save()
        except OSError as error:
            _warn_once(f"cache {self.cache_path}: {error}; {_NO_CACHE}")


_NO_CACHE: Final = (
    "compiled code is not cached, and each process compiles for up to a minute: "
    "set NUMBA_CACHE_DIR to a folder that can be written"
)
_warned: set[str] = set()


def _warn_once(text: str) -> None:
    """Warn of a fault of the cache, once for all functions that it concerns."""
    kind = text.rpartition(";")[2]
    if kind not in _warned:
        _warned.add(kind)
        warnings.warn(f"formation_env: {text}", RuntimeWarning, stacklevel=3)


def _numbers(typing_context: Any, table: Any, first: Any, i: Any, count: Any) -> Any:
    """The type of `numbers`, and how its code is generated."""
    if not isinstance(count, numba.types.IntegerLiteral):
        raise numba.errors.RequireLiteralValue("numbers: count must be a constant")
    size, lanes = count.literal_value, 1 if table.ndim == 2 else LANES
    result = numba.types.UniTuple(table.dtype, size)  # type: ignore[no-untyped-call]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        _, first, lane, _ = arguments
        loads = []
        for k in range(size):
            place = builder.mul(builder.add(first, first.type(k)), first.type(lanes))
            if lanes > 1:
                place = builder.add(place, lane)
            loads.append(context.unpack_value(builder, table.dtype, builder.gep(array.data, [place])))
        return context.make_tuple(builder, result, loads)

    return result(table, numba.types.intp, numba.types.intp, count), generate


numbers: Any = intrinsic(_numbers)
"""numbers(table, first, i, count): row i's numbers first, first + 1, ... of a table, as a tuple; count is a constant.

A table that all rows share is (1, numbers); else row i has its own in a flat one, (numbers * LANES,). Each number is a
load of its own, which the compiler drops if nobody needs it, and turns into vector loads in a loop over rows.
"""
