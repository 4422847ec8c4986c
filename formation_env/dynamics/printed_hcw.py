"""The modified HCW equations with the cross-track frequency as the thesis prints it."""

import math

from numpy.typing import ArrayLike

from formation_env.dynamics.modified_hcw import ModifiedHCW
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import R_EARTH
from formation_env.orbital.orbit import Orbit


class PrintedHCW(ModifiedHCW):
    """`ModifiedHCW` with Ma 2009, eq. (2.62) to the letter: k = n c + 3 J2 R_E^2 / (2 r1^2) cos^2 i, in rad/s.

    The second term lacks its n, so the cross-track motion of a leader at 600 km is 31 % too fast at 60 deg. No
    spacecraft moves like this; it is here because the thesis's closed-loop figures come out with it, and only with it.
    """

    def state_matrix(self, orbit: Orbit, spacecraft: Spacecraft, times_s: ArrayLike = 0.0) -> Array:
        """A (6, 6)."""
        A = super().state_matrix(orbit, spacecraft, times_s)
        n = orbit.mean_motion_rad_s
        missing_n = (
            3 / 2 * orbit.j2_coefficient * (R_EARTH / orbit.radius_m) ** 2 * math.cos(orbit.inclination_rad) ** 2
        )
        k = math.sqrt(-A[5, 2]) + (1 - n) * missing_n  # the term without its n in place of the one with it
        A[5, 2] = -(k**2)
        return A
