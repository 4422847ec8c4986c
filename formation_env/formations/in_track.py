"""The formation that flies over the leader's ground track."""

import math
from typing import Literal

import numpy as np

from formation_env.formations.base import Formation, need_circle
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import OMEGA_EARTH
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate
from formation_env.settings import settings


@settings
class InTrack(Formation):
    """Same ground track as the leader's (Ma 2009, eq. 3.7-3.9): the cross-track motion makes up for the Earth's turn.

    Attributes:
        y0_m: along-track offset, m; positive is ahead.
    """

    kind: Literal["in_track"] = "in_track"
    y0_m: Coordinate = 2000.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s: z = y0 (w_E / n) sin i cos nt."""
        need_circle(self.kind, orbit)
        amplitude = self.y0_m * OMEGA_EARTH / orbit.mean_motion_rad_s * math.sin(orbit.inclination_rad)
        return np.array([0, self.y0_m, amplitude, 0, 0, 0])
