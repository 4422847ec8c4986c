"""Hill-Clohessy-Wiltshire dynamics."""

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.base import Dynamics
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit


class HCW(Dynamics):
    """Relative motion about a circular Keplerian orbit (Ma 2009, eq. 2.54-2.56; Clohessy & Wiltshire 1960)."""

    def state_matrix(self, orbit: Orbit, spacecraft: Spacecraft, times_s: ArrayLike = 0.0) -> Array:
        """A (6, 6); the spacecraft plays no part."""
        n = orbit.mean_motion_rad_s
        A = np.zeros((6, 6))
        A[:3, 3:] = np.eye(3)
        A[3, [0, 4]] = 3 * n**2, 2 * n  # x'' = 3 n^2 x + 2 n y'
        A[4, 3] = -2 * n  # y'' = -2 n x'
        A[5, 2] = -(n**2)  # z'' = -n^2 z
        return A

    def disturbance(self, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> Array:
        """d (6,) = 0."""
        return np.zeros(6)


def transition_matrix(mean_motion_rad_s: float, time_s: ArrayLike) -> Array:
    """Closed-form HCW transition matrix (Ma 2009, eq. 3.2-3.4 and their derivatives).

    Args:
        mean_motion_rad_s: mean motion n of the leader, rad/s.
        time_s: elapsed times (...), s; negative ones run backwards.

    Returns:
        Phi (..., 6, 6).
    """
    n, t = mean_motion_rad_s, np.asarray(time_s, float)
    s, c = np.sin(n * t), np.cos(n * t)
    Phi = np.zeros((*t.shape, 6, 6))
    Phi[..., 0, 0] = 4 - 3 * c
    Phi[..., 0, 3] = s / n
    Phi[..., 0, 4] = 2 * (1 - c) / n
    Phi[..., 1, 0] = 6 * (s - n * t)
    Phi[..., 1, 1] = 1
    Phi[..., 1, 3] = -2 * (1 - c) / n
    Phi[..., 1, 4] = 4 * s / n - 3 * t
    Phi[..., 2, 2] = c
    Phi[..., 2, 5] = s / n
    Phi[..., 3, 0] = 3 * n * s
    Phi[..., 3, 3] = c
    Phi[..., 3, 4] = 2 * s
    Phi[..., 4, 0] = -6 * n * (1 - c)
    Phi[..., 4, 3] = -2 * s
    Phi[..., 4, 4] = 4 * c - 3
    Phi[..., 5, 2] = -n * s
    Phi[..., 5, 5] = c
    return Phi
