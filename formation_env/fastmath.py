"""Elementary functions that the compiler can vectorise: bit tricks and polynomials, no branch, no library call.

Each is accurate to 5e-10, far below what noise and float32 observations can show.
"""

from typing import Final

import numpy as np

from formation_env.jit import lane

_TWO_52: Final = 4503599627370496.0
_BITS_TWO_52: Final = np.uint64(0x4330000000000000)
_MANTISSA: Final = np.uint64(0x000FFFFFFFFFFFFF)
_BITS_ONE: Final = np.uint64(0x3FF0000000000000)
_SHIFT_52: Final = np.uint64(52)
_LN_2: Final = 0.6931471805599453
_SQRT_2: Final = 1.4142135623730951


def _log_series() -> tuple[float, ...]:
    """Polynomial for ln(1 + y) / y, where 1 + y is in [1/sqrt 2, sqrt 2]: the two meet in Chebyshev's nodes."""
    domain = (1 / _SQRT_2 - 1, _SQRT_2 - 1)
    fit = np.polynomial.Chebyshev.interpolate(lambda y: np.log1p(y) / y, 12, domain)
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


_LOG_SERIES: Final = _log_series()


@lane
def to_bits(x: float) -> np.uint64:
    """The 64 bits of a float, as an unsigned integer."""
    return np.float64(x).view(np.uint64)


@lane
def from_bits(word: np.uint64) -> float:
    """The float with these 64 bits."""
    return np.uint64(word).view(np.float64)


@lane
def to_integer(x: float) -> np.uint64:
    """The whole number nearest to x, 0 <= x < 2^52, as an unsigned integer."""
    return to_bits(x + _TWO_52) & _MANTISSA


@lane
def from_integer(word: np.uint64) -> float:
    """An unsigned integer below 2^52, as a float."""
    return from_bits(word | _BITS_TWO_52) - _TWO_52


@lane
def log(x: float) -> float:
    """Natural logarithm of a normal, positive, finite x."""
    word = to_bits(x)
    exponent = from_integer(word >> _SHIFT_52) - 1023.0
    mantissa = from_bits((word & _MANTISSA) | _BITS_ONE)
    # x = 2^e m with m in [1/sqrt 2, sqrt 2)
    high = mantissa > _SQRT_2
    exponent = exponent + 1.0 if high else exponent
    y = (0.5 * mantissa if high else mantissa) - 1.0
    c = _LOG_SERIES
    tail = c[7] + y * (c[8] + y * (c[9] + y * (c[10] + y * (c[11] + y * c[12]))))
    series = c[0] + y * (c[1] + y * (c[2] + y * (c[3] + y * (c[4] + y * (c[5] + y * (c[6] + y * tail))))))
    return exponent * _LN_2 + y * series


@lane
def cos_sin_turns(turns: float) -> tuple[float, float]:
    """Cosine and sine of 2 pi u for u in [0, 1]."""
    quadrant = from_integer(to_integer(4.0 * turns))  # rounds to the nearest
    a = 6.283185307179586 * (turns - 0.25 * quadrant)  # |a| <= pi / 4
    q = a * a
    s = a + a * q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880 + q * (-1 / 39916800)))))
    c = 1.0 + q * (-1 / 2 + q * (1 / 24 + q * (-1 / 720 + q * (1 / 40320 + q * (-1 / 3628800)))))
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    cosine, sine = (s, c) if odd else (c, s)
    cosine = -cosine if (quadrant == 1.0) | (quadrant == 2.0) else cosine
    sine = -sine if (quadrant == 2.0) | (quadrant == 3.0) else sine
    return cosine, sine
