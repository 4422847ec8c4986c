"""The least distance of two followers in the coming half orbit, if both coast by the HCW equations.

Single precision; lengths in units of L, velocities of n L, times of 1 / n (see `task.observation`), so that the
coasts have no parameter: x = x1 + xc cos t + xs sin t, y = y1 + yc cos t + ys sin t + yt t, z = zc cos t + zs sin t.
The least of SAMPLES + 1 instants is improved by Newton's method.
"""

from typing import Final, NamedTuple

import numpy as np

from formation_env.numerics.arrays import Array32
from formation_env.numerics.fastmath import fma
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.numerics.single_precision import cos_sin

SAMPLES: Final = 8
_TIMES: Final = np.linspace(0, np.pi, SAMPLES + 1)
_TIME: Final = tuple(np.float32(t) for t in _TIMES)
_COSINE: Final = tuple(np.float32(c) for c in np.cos(_TIMES))
_SINE: Final = tuple(np.float32(s) for s in np.sin(_TIMES))
_SPACING: Final = np.float32(np.pi / SAMPLES)
_PERIODS: Final = np.float32(0.5 / np.pi)
_PI: Final = np.float32(np.pi)
_QUARTER: Final = np.float32(np.pi / 2)
_ZERO, _ONE, _TWO, _THREE, _FOUR = (np.float32(k) for k in (0, 1, 2, 3, 4))


class Coast(NamedTuple):
    """Coefficients of a coast, see above."""

    x1: np.float32
    xc: np.float32
    xs: np.float32
    y1: np.float32
    yc: np.float32
    ys: np.float32
    yt: np.float32
    zc: np.float32
    zs: np.float32


@inline_scalar
def _coast(x: np.float32, y: np.float32, z: np.float32, u: np.float32, v: np.float32, w: np.float32) -> Coast:
    drift = _TWO * x + v
    double = _TWO * drift
    return Coast(double, x - double, u, y - _TWO * u, _TWO * u, _TWO * (double - x), -_THREE * drift, z, w)


@inline_scalar
def _square(o: Coast, cosine: np.float32, sine: np.float32, time: np.float32) -> np.float32:
    """Squared distance."""
    x = fma(cosine, o.xc, fma(sine, o.xs, o.x1))
    y = fma(cosine, o.yc, fma(sine, o.ys, fma(time, o.yt, o.y1)))
    z = fma(cosine, o.zc, sine * o.zs)
    return fma(x, x, fma(y, y, z * z))


@inline_scalar
def _nearer(best: tuple[np.float32, np.float32], o: Coast, k: int) -> tuple[np.float32, np.float32]:
    """The least squared distance and its time, with the k-th instant."""
    least, when = best
    square = _square(o, _COSINE[k], _SINE[k], _TIME[k])
    return min(square, least), _TIME[k] if square < least else when


@inline_scalar
def _newton(o: Coast, t: np.float32, low: np.float32, high: np.float32) -> np.float32:
    """A step towards the place where the distance does not change."""
    late = t - _QUARTER
    sine, minus_cosine = cos_sin(late)
    cosine = -minus_cosine
    p, q, z = fma(cosine, o.xc, sine * o.xs), fma(cosine, o.yc, sine * o.ys), fma(cosine, o.zc, sine * o.zs)
    x, y = o.x1 + p, fma(t, o.yt, o.y1 + q)
    u, w = fma(cosine, o.xs, -sine * o.xc), fma(cosine, o.zs, -sine * o.zc)
    v = fma(cosine, o.ys, fma(-sine, o.yc, o.yt))
    slope = fma(x, u, fma(y, v, z * w))
    bend = fma(u, u, fma(v, v, w * w)) - fma(x, p, fma(y, q, z * z))
    moved = t - slope / (bend if bend > _ZERO else _ONE)
    return min(max(moved if bend > _ZERO else t, low), high)


@tile_function
def closest_coast(state: Array32, distance: Array32, time: Array32, n: int) -> None:
    """Least distance and its time.

    Args:
        state: relative state, fields of LANES numbers (6 * LANES,).
        distance: written (LANES,), in L.
        time: written (LANES,), in periods.
        n: rows.
    """
    for i in range(min(n, LANES)):
        o = _coast(
            state[i],
            state[LANES + i],
            state[2 * LANES + i],
            state[3 * LANES + i],
            state[4 * LANES + i],
            state[5 * LANES + i],
        )
        best = _square(o, _ONE, _ZERO, _ZERO), _ZERO
        best = _nearer(best, o, 1)
        best = _nearer(best, o, 2)
        best = _nearer(best, o, 3)
        best = _nearer(best, o, 4)
        best = _nearer(best, o, 5)
        best = _nearer(best, o, 6)
        best = _nearer(best, o, 7)
        best = _nearer(best, o, 8)
        least, when = best
        low, high = max(when - _SPACING, _ZERO), min(when + _SPACING, _PI)
        t = _newton(o, when, low, high)
        t = _newton(o, t, low, high)
        sine, minus_cosine = cos_sin(t - _QUARTER)
        square = _square(o, -minus_cosine, sine, t)
        distance[i] = np.sqrt(min(square, least))
        time[i] = _PERIODS * (t if square < least else when)
