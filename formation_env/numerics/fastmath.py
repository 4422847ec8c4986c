"""Elementary functions that the compiler can vectorise: bit tricks and polynomials, no branch, no library call.

Each is accurate to 1e-9, far below what noise and float32 observations can show.
"""

from collections.abc import Callable
from typing import Any, Final, cast

import numpy as np
from numba import types
from numba.extending import intrinsic

from formation_env.numerics.jit import inline_scalar

_TWO_52: Final = 4503599627370496.0
_BITS_TWO_52: Final = np.uint64(0x4330000000000000)
_MANTISSA: Final = np.uint64(0x000FFFFFFFFFFFFF)
_EXPONENT: Final = np.uint64(0x7FF0000000000000)
_BITS_ONE: Final = np.uint64(0x3FF0000000000000)
_BITS_ONE_OVER_LEAST: Final = _BITS_ONE - np.float64(0.5**0.5).view(np.uint64)  # least mantissa: 1 / sqrt 2
_SHIFT_52: Final = np.uint64(52)
_LN_2: Final = 0.6931471805599453


@intrinsic
def _fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    signature = types.float64(types.float64, types.float64, types.float64)
    return signature, lambda context, builder, _, arguments: builder.fma(*arguments)


fma = cast(Callable[[float, float, float], float], _fma)
"""a * b + c, rounded once: one instruction, and the same bits in a vector and alone."""


@inline_scalar
def polynomial_4(x: float, c: tuple[float, ...]) -> float:
    """c0 + c1 x + ... + c4 x^4."""
    return fma(fma(fma(fma(c[4], x, c[3]), x, c[2]), x, c[1]), x, c[0])


def _log_series() -> tuple[float, ...]:
    """Polynomial for ln(1 + y) / y, where 1 + y is in [1/sqrt 2, sqrt 2]: the two meet in Chebyshev's nodes."""
    domain = (0.5**0.5 - 1, 2**0.5 - 1)
    fit = np.polynomial.Chebyshev.interpolate(lambda y: np.log1p(y) / y, 10, domain)
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


_LOG_SERIES: Final = _log_series()


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


@inline_scalar
def log(x: float) -> float:
    """Natural logarithm of a normal, positive, finite x."""
    # x = 2^e m with m in [1/sqrt 2, sqrt 2)
    word = to_bits(x)
    shifted = word + _BITS_ONE_OVER_LEAST
    exponent = from_integer(shifted >> _SHIFT_52) - 1023.0
    y = from_bits(word - (shifted & _EXPONENT) + _BITS_ONE) - 1.0
    c = _LOG_SERIES
    series = fma(polynomial_4(y, c[6:]), y, c[5])
    series = fma(fma(fma(fma(fma(series, y, c[4]), y, c[3]), y, c[2]), y, c[1]), y, c[0])
    return fma(y, series, exponent * _LN_2)


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


_SINE: Final = (-1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800)  # Taylor, from a^3 on
_COSINE: Final = (-1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800)  # from a^2 on


@inline_scalar
def cos_sin_turns(turns: float) -> tuple[float, float]:
    """Cosine and sine of 2 pi u for u in [0, 1]."""
    quadrant = from_integer(to_integer(4.0 * turns))  # rounds to the nearest
    a = 6.283185307179586 * (turns - 0.25 * quadrant)  # |a| <= pi / 4
    q = a * a
    s = fma(a * q, polynomial_4(q, _SINE), a)
    c = fma(q, polynomial_4(q, _COSINE), 1.0)
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    cosine, sine = (s, c) if odd else (c, s)
    cosine = -cosine if (quadrant == 1.0) | (quadrant == 2.0) else cosine
    sine = -sine if (quadrant == 2.0) | (quadrant == 3.0) else sine
    return cosine, sine
