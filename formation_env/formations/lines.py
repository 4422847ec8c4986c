"""Formations of constant offset."""

from typing import Literal

import numpy as np

from formation_env.formations.base import Formation, need_circle
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import MU_EARTH
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate
from formation_env.settings import settings


@settings
class Following(Formation):
    """On the leader's orbit, ahead of or behind it (Ma 2009, eq. 3.5).

    Attributes:
        y0_m: along-track offset, m; positive is ahead.
    """

    kind: Literal["following"] = "following"
    y0_m: Coordinate = 2000.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s: the leader's own motion, y0 / (r theta') seconds ahead of it."""
        r, speed, rate = orbit.polar_motion(time_s)
        ahead_s = self.y0_m / (r * rate)
        # d/dt (r', r theta') = (r'', -r' theta'), r'' = e cos(theta) mu / r^2
        outward = orbit.eccentricity * np.cos(orbit.true_anomaly_rad(time_s)) * MU_EARTH / r**2
        return np.array([ahead_s * speed, self.y0_m, 0, ahead_s * outward, -ahead_s * speed * rate, 0])


@settings
class Parallel(Formation):
    """On a circular orbit above or below the leader's (Ma 2009, eq. 3.6), so drifting along it at -1.5 n x0.

    Attributes:
        x0_m: radial offset, m.
    """

    kind: Literal["parallel"] = "parallel"
    x0_m: Coordinate = 1000.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        need_circle(self.kind, orbit)
        return np.array([self.x0_m, 0, 0, 0, -1.5 * orbit.mean_motion_rad_s * self.x0_m, 0])
