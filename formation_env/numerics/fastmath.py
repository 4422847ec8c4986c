"""Elementary functions that the compiler can vectorise: bit tricks and polynomials, no branch, no library call.

Each is accurate to 1e-9, far below what noise and float32 observations can show.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numpy as np
from numba import types
from numba.extending import intrinsic

from formation_env.numerics.jit import inline_scalar

_TWO_52: Final = 4503599627370496.0
_BITS_TWO_52: Final = np.uint64(0x4330000000000000)
_MANTISSA: Final = np.uint64(0x000FFFFFFFFFFFFF)
_SHIFT_52: Final = np.uint64(52)
_LN_2: Final = 0.6931471805599453


@intrinsic
def _fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    number = types.float32 if a == b == c == types.float32 else types.float64
    return number(number, number, number), lambda context, builder, _, arguments: builder.fma(*arguments)


N = TypeVar("N", float, np.float32)
fma = cast(Callable[[N, N, N], N], _fma)
"""a * b + c, rounded once: one instruction, and the same bits in a vector and alone; single if all three are."""


@inline_scalar
def polynomial_4(x: float, c: tuple[float, ...]) -> float:
    """c0 + c1 x + ... + c4 x^4."""
    return fma(fma(fma(fma(c[4], x, c[3]), x, c[2]), x, c[1]), x, c[0])


@inline_scalar
def to_bits(x: float) -> np.uint64:
    """The 64 bits of a float, as an unsigned integer."""
    return np.float64(x).view(np.uint64)


@inline_scalar
def from_bits(word: np.uint64) -> float:
    """The float with these 64 bits."""
    return np.uint64(word).view(np.float64)


@inline_scalar
def to_integer(x: float) -> np.uint64:
    """The whole number nearest to x, 0 <= x < 2^52, as an unsigned integer."""
    return to_bits(x + _TWO_52) & _MANTISSA


@inline_scalar
def from_integer(word: np.uint64) -> float:
    """An unsigned integer below 2^52, as a float."""
    return from_bits(word | _BITS_TWO_52) - _TWO_52


_EXP_SERIES: Final = (1.0, 1.0, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720, 1 / 5040, 1 / 40320, 1 / 362880)  # Taylor
_BIAS: Final = 1023.0


@inline_scalar
def exp(x: float) -> float:
    """e^x; below -700 and above 700 the value there."""
    # x = k ln 2 + y with |y| <= ln 2 / 2; 2^k by its exponent bits
    turns = min(max(x, -700.0), 700.0) / _LN_2
    biased = from_integer(to_integer(turns + _BIAS))  # rounds to the nearest
    y = (turns + _BIAS - biased) * _LN_2
    c = _EXP_SERIES
    series = fma(polynomial_4(y, c[5:]), y, c[4])
    series = fma(fma(fma(fma(series, y, c[3]), y, c[2]), y, c[1]), y, c[0])
    return series * from_bits(to_integer(biased) << _SHIFT_52)
