"""HCW dynamics with J2 and air drag."""

import math

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.base import Dynamics
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import R_EARTH
from formation_env.orbital.orbit import Orbit


class ModifiedHCW(Dynamics):
    """Relative motion under J2 and drag (Ma 2009, eq. 2.57-2.70; Schweighart & Sedwick 2002).

    In the thesis both spacecraft have the same ballistic coefficient; where they differ, the leader's and the
    follower's drag differ by a constant along-track acceleration.
    """

    def state_matrix(self, orbit: Orbit, spacecraft: Spacecraft, times_s: ArrayLike = 0.0) -> Array:
        """A (6, 6)."""
        n, r, i = orbit.mean_motion_rad_s, orbit.radius_m, orbit.inclination_rad
        oblateness = orbit.j2_coefficient * (R_EARTH / r) ** 2
        s = 3 / 8 * oblateness * (1 + 3 * math.cos(2 * i))  # eq. (2.60)
        c = math.sqrt(1 + s)
        k = n * c + 3 / 2 * n * oblateness * math.cos(i) ** 2  # eq. (2.65), with the n lost in print
        drag = spacecraft.drag_rate_per_speed * orbit.speed_m_s  # rho v1 / B
        A = np.zeros((6, 6))
        A[:3, 3:] = np.eye(3)
        # x'' - 2 n c y' - (5 c^2 - 2) n^2 x = f_x - rho v1 / (2 B) (x' - n y)
        A[3, [0, 1, 3, 4]] = (5 * c**2 - 2) * n**2, drag / 2 * n, -drag / 2, 2 * n * c
        # y'' + 2 n c x' = f_y - rho v1 / B (y' + n x): twice the other axes', the derivative of v^2
        A[4, [0, 3, 4]] = -drag * n, -2 * n * c, -drag
        # z'' + k^2 z = f_z - rho v1 / (2 B) z'
        A[5, [2, 5]] = -(k**2), -drag / 2
        return A

    def disturbance(self, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> Array:
        """d (6,): y'' = -rho v1^2 / 2 (1/B_follower - 1/B_leader)."""
        difference = spacecraft.drag_rate_per_speed - leader.drag_rate_per_speed
        return np.array([0, 0, 0, 0, -0.5 * orbit.speed_m_s**2 * difference, 0])
