"""The sensor and the discrete Kalman filter (Ma 2009, eq. 4.69-4.75).

Legend: x_hat estimate, P error covariance, Phi transition matrix, Q_noise and R_noise noise covariances.

In the linear models the orbit plane (x, y, x', y') and the cross-track axis (z, z') do not influence each other, nor do
their measurement errors; so their covariances have no common elements and they are filtered apart. A symmetric matrix
is a tuple of its upper triangle, row by row. Measurements are independent, so they are taken one at a time.
"""

from typing import Final

from formation_env.numerics.fastmath import fma
from formation_env.numerics.jit import inline_scalar

Symmetric2 = tuple[float, float, float]
Symmetric4 = tuple[float, float, float, float, float, float, float, float, float, float]
State4 = tuple[float, float, float, float]
Matrix2 = tuple[float, float, float, float]

LEAST_SHARE: Final = 2.0**-26
"""Least share of an unmeasured element's variance that one measurement leaves.

It is the square root of a double's rounding: a variance below it is a difference that has lost half of its digits, and
the next measurement would lose the other half and find a negative one. Such a variance is too large then, which is
safe, and a few measurements later right.
"""
LEAST_VARIANCE: Final = 1e-20
"""Least variance of a measurement, m^2 and m^2/s^2: the rounding of a perfect one."""


@inline_scalar
def _at_least(value: float, floor: float) -> float:
    return value if value > floor else floor


@inline_scalar
def time_update_2(P: Symmetric2, Phi: Matrix2, Q_noise: Symmetric2) -> Symmetric2:
    """Phi P Phi' + Q_noise of the cross-track axis (eq. 4.75)."""
    p00, p01, p11 = P
    a, b, c, d = Phi
    u0, u1 = a * p00 + b * p01, a * p01 + b * p11
    v0, v1 = c * p00 + d * p01, c * p01 + d * p11
    return (
        _at_least(u0 * a + u1 * b, 0.0) + Q_noise[0],
        u0 * c + u1 * d + Q_noise[1],
        _at_least(v0 * c + v1 * d, 0.0) + Q_noise[2],
    )


@inline_scalar
def _dot(u: State4, a: float, b: float, c: float, d: float) -> float:
    return fma(u[0], a, fma(u[1], b, fma(u[2], c, u[3] * d)))


@inline_scalar
def _times_symmetric(a: float, b: float, c: float, d: float, P: Symmetric4) -> State4:
    """Row vector times symmetric matrix."""
    p00, p01, p02, p03, p11, p12, p13, p22, p23, p33 = P
    row = (a, b, c, d)
    return (
        _dot(row, p00, p01, p02, p03),
        _dot(row, p01, p11, p12, p13),
        _dot(row, p02, p12, p22, p23),
        _dot(row, p03, p13, p23, p33),
    )


@inline_scalar
def time_update_4(P: Symmetric4, Phi: tuple[float, ...], Q_noise: Symmetric4) -> Symmetric4:
    """Phi P Phi' + Q_noise of the orbit plane (eq. 4.75); Phi row by row (16)."""
    a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, d0, d1, d2, d3 = Phi
    a = _times_symmetric(a0, a1, a2, a3, P)
    b = _times_symmetric(b0, b1, b2, b3, P)
    c = _times_symmetric(c0, c1, c2, c3, P)
    d = _times_symmetric(d0, d1, d2, d3, P)
    return (
        _at_least(_dot(a, a0, a1, a2, a3), 0.0) + Q_noise[0],
        _dot(a, b0, b1, b2, b3) + Q_noise[1],
        _dot(a, c0, c1, c2, c3) + Q_noise[2],
        _dot(a, d0, d1, d2, d3) + Q_noise[3],
        _at_least(_dot(b, b0, b1, b2, b3), 0.0) + Q_noise[4],
        _dot(b, c0, c1, c2, c3) + Q_noise[5],
        _dot(b, d0, d1, d2, d3) + Q_noise[6],
        _at_least(_dot(c, c0, c1, c2, c3), 0.0) + Q_noise[7],
        _dot(c, d0, d1, d2, d3) + Q_noise[8],
        _at_least(_dot(d, d0, d1, d2, d3), 0.0) + Q_noise[9],
    )


@inline_scalar
def thrust_noise_update_4(P: Symmetric4, Gamma: tuple[float, ...], ax: float, ay: float, variance: float) -> Symmetric4:
    """P + variance (Gamma a) (Gamma a)': the uncertainty of a thrust a whose magnitude has a relative error.

    The same error acts on the cross-track axis. That correlation between the two parts of the state is left out.
    """
    p00, p01, p02, p03, p11, p12, p13, p22, p23, p33 = P
    g0, g1 = Gamma[0] * ax + Gamma[1] * ay, Gamma[2] * ax + Gamma[3] * ay
    g2, g3 = Gamma[4] * ax + Gamma[5] * ay, Gamma[6] * ax + Gamma[7] * ay
    v0, v1, v2, v3 = variance * g0, variance * g1, variance * g2, variance * g3
    return (
        p00 + v0 * g0,
        p01 + v0 * g1,
        p02 + v0 * g2,
        p03 + v0 * g3,
        p11 + v1 * g1,
        p12 + v1 * g2,
        p13 + v1 * g3,
        p22 + v2 * g2,
        p23 + v2 * g3,
        p33 + v3 * g3,
    )


@inline_scalar
def thrust_noise_update_2(P: Symmetric2, Gamma: tuple[float, float], az: float, variance: float) -> Symmetric2:
    """Add the uncertainty of a thrust to the cross-track covariance, see `thrust_noise_update_4`."""
    g0, g1 = Gamma[0] * az, Gamma[1] * az
    return P[0] + variance * g0 * g0, P[1] + variance * g0 * g1, P[2] + variance * g1 * g1


@inline_scalar
def measure_first(
    x_hat: State4, P: Symmetric4, z: float, variance: float, received: float
) -> tuple[State4, Symmetric4, float]:
    """Measurement update (eq. 4.71-4.73) with one measurement of the state's first element.

    For this gain the measured element's row of (I - K H) P is R_noise / (P + R_noise) times that of P, without a
    difference; the rest is P - K H P. The result is symmetric by construction, and no variance becomes negative, see
    `LEAST_SHARE`.

    A sensor without noise is always believed, also where the covariance of the element is 0 and eq. (4.71) divides zero
    by zero: its variance counts as `LEAST_VARIANCE`.

    Args:
        x_hat: estimate (4).
        P: its covariance (10).
        z: the measurement.
        variance: R_noise of the measurement.
        received: 1 if it arrived, else 0; then nothing changes.

    Returns:
        Estimate, covariance, and the squared innovation over its variance.
    """
    x0, x1, x2, x3 = x_hat
    p00, p01, p02, p03, p11, p12, p13, p22, p23, p33 = P
    perfect = variance <= LEAST_VARIANCE
    variance = _at_least(variance, LEAST_VARIANCE)
    weight = received / (p00 + variance)
    innovation = z - x0
    # K = P H' / s, and the share of the measured row that is left, R_noise / s
    k0 = received if perfect else p00 * weight
    k1, k2, k3 = p01 * weight, p02 * weight, p03 * weight
    share = variance * weight + (1.0 - received)
    new_x = (
        fma(k0, innovation, x0),
        fma(k1, innovation, x1),
        fma(k2, innovation, x2),
        fma(k3, innovation, x3),
    )
    new_P = (
        share * p00,
        share * p01,
        share * p02,
        share * p03,
        _at_least(fma(-k1, p01, p11), LEAST_SHARE * p11),
        fma(-k1, p02, p12),
        fma(-k1, p03, p13),
        _at_least(fma(-k2, p02, p22), LEAST_SHARE * p22),
        fma(-k2, p03, p23),
        _at_least(fma(-k3, p03, p33), LEAST_SHARE * p33),
    )
    return new_x, new_P, innovation * innovation * weight


@inline_scalar
def measure_pair_4(
    x_hat: State4, P: Symmetric4, z: tuple[float, float], variance: float, received: float
) -> tuple[State4, Symmetric4, float]:
    """Take measurements of the state's first two elements, one after the other.

    Args:
        x_hat: estimate (a, b, c, d).
        P: its covariance.
        z: the measurements of a and b.
        variance: of either.
        received: 1 or 0.

    Returns:
        Estimate, covariance, normalised innovation squared.
    """
    (a, b, c, d), (aa, ab, ac, ad, bb, bc, bd, cc, cd, dd), nis_a = measure_first(x_hat, P, z[0], variance, received)
    (b, a, c, d), (bb, ab, bc, bd, aa, ac, ad, cc, cd, dd), nis_b = measure_first(
        (b, a, c, d), (bb, ab, bc, bd, aa, ac, ad, cc, cd, dd), z[1], variance, received
    )
    return (a, b, c, d), (aa, ab, ac, ad, bb, bc, bd, cc, cd, dd), nis_a + nis_b


@inline_scalar
def measure_velocities_4(
    x_hat: State4, P: Symmetric4, z: tuple[float, float], variance: float, received: float
) -> tuple[State4, Symmetric4, float]:
    """Take measurements of the last two elements of (x, y, x', y'), see `measure_pair_4`."""
    x, y, u, v = x_hat
    xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = P
    (u, v, x, y), (uu, uv, xu, yu, vv, xv, yv, xx, xy, yy), nis = measure_pair_4(
        (u, v, x, y), (uu, uv, xu, yu, vv, xv, yv, xx, xy, yy), z, variance, received
    )
    return (x, y, u, v), (xx, xy, xu, xv, yy, yu, yv, uu, uv, vv), nis


@inline_scalar
def measure_first_2(
    x_hat: tuple[float, float], P: Symmetric2, z: float, variance: float, received: float
) -> tuple[tuple[float, float], Symmetric2, float]:
    """`measure_first` with two of its states unused."""
    (a, b, _, _), (aa, ab, _, _, bb, _, _, _, _, _), nis = measure_first(
        (x_hat[0], x_hat[1], 0.0, 0.0),
        (P[0], P[1], 0.0, 0.0, P[2], 0.0, 0.0, 0.0, 0.0, 0.0),
        z,
        variance,
        received,
    )
    return (a, b), (aa, ab, bb), nis


@inline_scalar
def measure_second_2(
    x_hat: tuple[float, float], P: Symmetric2, z: float, variance: float, received: float
) -> tuple[tuple[float, float], Symmetric2, float]:
    """Take a measurement of the second of two elements."""
    (b, a), (bb, ab, aa), nis = measure_first_2((x_hat[1], x_hat[0]), (P[2], P[1], P[0]), z, variance, received)
    return (a, b), (aa, ab, bb), nis
