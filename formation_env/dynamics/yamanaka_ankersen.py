"""Relative motion about an elliptic Keplerian orbit.

Legend: e eccentricity, theta true anomaly, rho = 1 + e cos theta, p semi-latus rectum, k2 = h / p^2, so that
theta' = k2 rho^2.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.base import DiscreteModel, Dynamics, control_matrix
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.kepler import solve_kepler, true_to_mean
from formation_env.orbital.orbit import Orbit

FEWEST_NODES: Final = 6
"""Nodes of the input matrix's quadrature for short steps."""
NODES_PER_RADIAN: Final = 5
"""Further nodes for each radian of eccentric anomaly in a step: exact to rounding up to e = 0.9 and half an orbit."""


class YamanakaAnkersen(Dynamics):
    """Relative motion about an elliptic orbit, without perturbations (Yamanaka & Ankersen 2002)."""

    time_invariant = False

    def state_matrix(self, orbit: Orbit, spacecraft: Spacecraft, times_s: ArrayLike = 0.0) -> Array:
        """A (..., 6, 6) at times (...), s (Tschauner & Hempel 1965); the spacecraft plays no part."""
        rho, rate, _ = _anomaly(orbit, times_s)
        # mu / r^3 = theta'^2 / rho; theta'' = -2 e sin(theta) theta'^2 / rho
        pull = rate**2 / rho
        turn = -2 * orbit.eccentricity * np.sin(orbit.true_anomaly_rad(times_s)) * rate**2 / rho
        A = np.zeros((*np.shape(rate), 6, 6))
        A[..., :3, 3:] = np.eye(3)
        # x'' = (theta'^2 + 2 mu / r^3) x + theta'' y + 2 theta' y'
        A[..., 3, 0], A[..., 3, 1], A[..., 3, 4] = rate**2 + 2 * pull, turn, 2 * rate
        # y'' = -theta'' x + (theta'^2 - mu / r^3) y - 2 theta' x'
        A[..., 4, 0], A[..., 4, 1], A[..., 4, 3] = -turn, rate**2 - pull, -2 * rate
        # z'' = -mu / r^3 z
        A[..., 5, 2] = -pull
        return A

    def disturbance(self, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> Array:
        """d (6,) = 0."""
        return np.zeros(6)

    def discretise(
        self, start_s: ArrayLike, step_s: ArrayLike, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft
    ) -> DiscreteModel:
        """Phi in closed form, Gamma = integral of Phi(end, s) B ds by Gauss's quadrature (Ma 2009, eq. 4.6-4.7)."""
        start, step = np.broadcast_arrays(np.asarray(start_s, float), np.asarray(step_s, float))
        end = start + step
        nodes, weights_s = _quadrature(orbit, start, step)
        inputs = transition_matrix(orbit, nodes, end[..., None]) @ control_matrix()
        Gamma = np.einsum("...q,...qij->...ij", weights_s, inputs)
        return DiscreteModel(transition_matrix(orbit, start, end), Gamma, np.zeros((*start.shape, 6)))


def _quadrature(orbit: Orbit, start_s: Array, step_s: Array) -> tuple[Array, Array]:
    """Instants (..., q) and weights (..., q), s, of an integral over time steps (...): Gauss's in eccentric anomaly E.

    In time the integrand has a peak at perigee, in E it is smooth: dt = (1 - e cos E) / n dE.
    """
    e, n = orbit.eccentricity, orbit.mean_motion_rad_s
    mean = true_to_mean(np.radians(orbit.true_anomaly_deg), e) + n * start_s
    mean = mean - 2 * np.pi * np.round(mean / (2 * np.pi))  # small numbers keep their digits
    E_start, E_end = solve_kepler(mean, e)[..., None], solve_kepler(mean + n * step_s, e)[..., None]
    half = (E_end - E_start) / 2
    count = FEWEST_NODES + int(NODES_PER_RADIAN * 2 * np.max(np.abs(half), initial=0.0))
    places, weights = np.polynomial.legendre.leggauss(count)
    E = E_start + half * (1 + places)
    elapsed_s = (E - E_start - e * (np.sin(E) - np.sin(E_start))) / n
    return start_s[..., None] + elapsed_s, half * weights * (1 - e * np.cos(E)) / n


def transition_matrix(orbit: Orbit, start_s: ArrayLike, end_s: ArrayLike) -> Array:
    """Yamanaka & Ankersen's transition matrix in LVLH (2002, eq. 80-86), for an elliptic or a circular orbit.

    Args:
        orbit: the leader's orbit.
        start_s: times (...) to start at, s.
        end_s: times (...) to end at, s; before the start, too.

    Returns:
        Phi (..., 6, 6).
    """
    start, end = np.broadcast_arrays(np.asarray(start_s, float), np.asarray(end_s, float))
    before, after = _fundamental(orbit, start, np.zeros_like(start)), _fundamental(orbit, end, end - start)
    return np.asarray(after @ np.linalg.inv(before))


def _anomaly(orbit: Orbit, times_s: ArrayLike) -> tuple[Array, Array, float]:
    """rho and theta' (...) at times (...), and k2."""
    e = orbit.eccentricity
    rho = 1 + e * np.cos(orbit.true_anomaly_rad(times_s))
    k2 = orbit.mean_motion_rad_s / (1 - e**2) ** 1.5
    return rho, k2 * rho**2, k2


def _fundamental(orbit: Orbit, times_s: Array, elapsed_s: Array) -> Array:
    """Six solutions (..., 6, 6), as columns, at times (...); J = k2 elapsed is the one secular term."""
    e, theta = orbit.eccentricity, orbit.true_anomaly_rad(times_s)
    rho, _, k2 = _anomaly(orbit, times_s)
    s, c, J = rho * np.sin(theta), rho * np.cos(theta), k2 * elapsed_s
    ds, dc = np.cos(theta) + e * np.cos(2 * theta), -np.sin(theta) - e * np.sin(2 * theta)
    zero, one = np.zeros_like(rho), np.ones_like(rho)
    # Scaled coordinates rho x, rho y and their derivatives by theta; V-bar is y, R-bar is -x.
    x = np.stack([zero, -s, -c, -(2 - 3 * e * s * J)], -1)
    y = np.stack([one, -c * (1 + 1 / rho), s * (1 + 1 / rho), 3 * rho**2 * J], -1)
    dx = np.stack([zero, -ds, -dc, 3 * e * (ds * J + s / rho**2)], -1)
    dy = np.stack([zero, 2 * s, 2 * c - e, 3 * (1 - 2 * e * s * J)], -1)
    z, dz = np.stack([np.cos(theta), np.sin(theta)], -1), np.stack([-np.sin(theta), np.cos(theta)], -1)
    W = np.zeros((*rho.shape, 6, 6))
    # x = x~ / rho;  x' = k2 (e sin(theta) x~ + rho dx~/dtheta)
    rho_, slope = rho[..., None], (e * np.sin(theta))[..., None]
    for row, value, derivative, columns in ((0, x, dx, slice(0, 4)), (1, y, dy, slice(0, 4)), (2, z, dz, slice(4, 6))):
        W[..., row, columns] = value / rho_
        W[..., row + 3, columns] = k2 * (slope * value + rho_ * derivative)
    return W
