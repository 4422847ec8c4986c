"""Kepler's equation and the three anomalies on an ellipse (Ma 2009, section 2.2.3).

All functions work on arrays of any leading shape (...), and an anomaly comes out in the revolution of the one that
went in, so that it grows on with time. Legend: E eccentric, M mean, nu true anomaly, e eccentricity.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]

MAX_NEWTON_STEPS = 12
"""Seven reach the rounding for all anomalies with e up to 1 - 1e-15."""


def elliptic(eccentricity: ArrayLike) -> Array:
    """Eccentricities (...) as an array; ValueError unless all are in [0, 1)."""
    e = np.asarray(eccentricity, float)
    if not np.all((e >= 0) & (e < 1)):
        raise ValueError(f"eccentricity: must be in [0, 1), got {e[~((e >= 0) & (e < 1))].flat[0]}")
    return e


def solve_kepler(mean_anomaly_rad: ArrayLike, eccentricity: ArrayLike) -> Array:
    """Eccentric anomaly E with E - e sin E = M (Vallado 2013, section 2.2.5), in M's own revolution.

    On [0, pi] the left side is convex, so Newton's iteration falls monotonically from any upper bound of the root.

    Args:
        mean_anomaly_rad: M (...), rad.
        eccentricity: e (...), in [0, 1).

    Returns:
        E (...), rad.

    Raises:
        ValueError: an eccentricity outside [0, 1).
    """
    mean, e = np.broadcast_arrays(np.asarray(mean_anomaly_rad, float), elliptic(eccentricity))
    # in [-pi, pi], and exact where M is small
    folded = mean - 2 * np.pi * np.round(mean / (2 * np.pi))
    M = np.minimum(np.abs(folded), np.pi)
    # E (1 - e) <= M and e E^3 / pi^2 <= M, as E - sin E >= E^3 / pi^2 on [0, pi]; below e = 0.3 the first is closer
    cubic = np.cbrt(np.pi**2 * M / np.maximum(e, 0.1))
    E: Array = np.minimum.reduce([M + e, M / (1 - e), cubic, np.full_like(M, np.pi)])
    for _ in range(MAX_NEWTON_STEPS):
        step = (E - e * np.sin(E) - M) / (1 - e * np.cos(E))
        E = E - step
        if np.all(np.abs(step) <= 1e-15 * E):
            break
    solution: Array = mean + np.sign(folded) * (E - M)
    return solution


def mean_to_true(mean_anomaly_rad: ArrayLike, eccentricity: ArrayLike) -> Array:
    """True anomaly (...) from the mean one (...), rad, in the same revolution; e (...) in [0, 1) else ValueError."""
    return eccentric_to_true(solve_kepler(mean_anomaly_rad, eccentricity), eccentricity)


def true_to_mean(true_anomaly_rad: ArrayLike, eccentricity: ArrayLike) -> Array:
    """Mean anomaly (...) from the true one (...), rad, in the same revolution; e (...) in [0, 1) else ValueError."""
    E = true_to_eccentric(true_anomaly_rad, eccentricity)
    # M = E - e sin E
    mean: Array = E - np.asarray(eccentricity, float) * np.sin(E)
    return mean


def eccentric_to_true(eccentric_anomaly_rad: ArrayLike, eccentricity: ArrayLike) -> Array:
    """True anomaly (...) from the eccentric one (...), rad, in the same revolution (Battin 1999, section 4.3).

    Raises:
        ValueError: an eccentricity outside [0, 1).
    """
    E, beta = np.asarray(eccentric_anomaly_rad, float), _half_angle_ratio(eccentricity)
    # tan((nu - E)/2) = beta sin E / (1 - beta cos E)
    nu: Array = E + 2 * np.arctan2(beta * np.sin(E), 1 - beta * np.cos(E))
    return nu


def true_to_eccentric(true_anomaly_rad: ArrayLike, eccentricity: ArrayLike) -> Array:
    """Eccentric anomaly (...) from the true one (...), rad, in the same revolution (Battin 1999, section 4.3).

    Raises:
        ValueError: an eccentricity outside [0, 1).
    """
    nu, beta = np.asarray(true_anomaly_rad, float), _half_angle_ratio(eccentricity)
    # tan((nu - E)/2) = beta sin nu / (1 + beta cos nu)
    E: Array = nu - 2 * np.arctan2(beta * np.sin(nu), 1 + beta * np.cos(nu))
    return E


def _half_angle_ratio(eccentricity: ArrayLike) -> Array:
    """The factor e / (1 + sqrt(1 - e^2)) between half angles."""
    e = elliptic(eccentricity)
    ratio: Array = e / (1 + np.sqrt(1 - e**2))
    return ratio
