"""Elementary functions of single-precision numbers that the compiler can vectorise, see `fastmath`.

Each is accurate to 1e-6 of its result or better. A product of a float32 and a Python float would be double, so all
constants are float32.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import fma
from formation_env.numerics.jit import inline_scalar

_BITS_LEAST: Final = np.float32(0.5**0.5).view(np.int32)  # least mantissa: 1 / sqrt 2
_EXPONENT: Final = np.int32(-(2**23))  # all bits but those of the mantissa
_SHIFT: Final = np.int32(23)
_ONE: Final = np.float32(1)
_LN_2: Final = np.float32(np.log(2))


def _log_series(degree: int) -> tuple[np.float32, ...]:
    """Polynomial for ln(1 + y) / y, where 1 + y is in [1/sqrt 2, sqrt 2]: the two meet in Chebyshev's nodes."""
    domain = (0.5**0.5 - 1, 2**0.5 - 1)
    fit = np.polynomial.Chebyshev.interpolate(lambda y: np.log1p(y) / y, degree, domain)
    return tuple(np.float32(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


_LOG_SERIES: Final = _log_series(7)


def _arc_series(function: Callable[[Array], Array], degree: int) -> tuple[np.float32, ...]:
    """Polynomial in q = a^2 for an even function of a in [-pi/2, pi/2]."""
    fit = np.polynomial.Chebyshev.interpolate(lambda q: function(np.sqrt(q)), degree, (0, (np.pi / 2) ** 2))
    return tuple(np.float32(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


_SINE: Final = _arc_series(lambda a: np.sinc(a / np.pi), 4)
_COSINE: Final = _arc_series(np.cos, 5)


@inline_scalar
def log(x: np.float32) -> np.float32:
    """Natural logarithm of a normal, positive, finite x."""
    # x = 2^e m with m in [1/sqrt 2, sqrt 2)
    word = np.float32(x).view(np.int32)
    above = np.int32(word - _BITS_LEAST)
    exponent = np.float32(np.int32(above >> _SHIFT))
    y = np.int32(word - np.int32(above & _EXPONENT)).view(np.float32) - _ONE
    c = _LOG_SERIES
    q = y * y
    # Estrin's scheme: short chains, which overlap
    low = fma(fma(c[3], y, c[2]), q, fma(c[1], y, c[0]))
    high = fma(fma(c[7], y, c[6]), q, fma(c[5], y, c[4]))
    series = fma(high, q * q, low)
    return fma(y, series, exponent * _LN_2)


@inline_scalar
def cos_sin(a: np.float32) -> tuple[np.float32, np.float32]:
    """Cosine and sine of an angle in [-pi/2, pi/2], rad."""
    q = a * a
    c, s = _COSINE, _SINE
    sine = fma(fma(fma(fma(s[4], q, s[3]), q, s[2]), q, s[1]), q, s[0])
    cosine = fma(fma(fma(fma(fma(c[5], q, c[4]), q, c[3]), q, c[2]), q, c[1]), q, c[0])
    return cosine, a * sine
