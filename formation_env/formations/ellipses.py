"""Formations that circle the leader once per orbit."""

import math
from typing import Literal

from formation_env.formations.base import Formation, closed_ellipse
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate, VelocityComponent
from formation_env.settings import settings


@settings
class XYEllipse(Formation):
    """2 x 1 ellipse in the orbit plane (Ma 2009, section 3.1.4).

    Attributes:
        x0_m: radial position at t = 0, m.
        vx0_m_s: radial velocity at t = 0, m/s.
    """

    kind: Literal["xy_ellipse"] = "xy_ellipse"
    x0_m: Coordinate = 2000.0
    vx0_m_s: VelocityComponent = 0.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        return closed_ellipse(self.x0_m, self.vx0_m_s, 0.0, orbit, time_s)


@settings
class SpaceCircle(Formation):
    """Constant distance to the leader: z = sqrt(3) x (Ma 2009, section 3.1.5).

    Attributes:
        x0_m: radial position at t = 0, m.
        vx0_m_s: radial velocity at t = 0, m/s.
    """

    kind: Literal["space_circle"] = "space_circle"
    x0_m: Coordinate = 2000.0
    vx0_m_s: VelocityComponent = 0.2

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        return closed_ellipse(self.x0_m, self.vx0_m_s, math.sqrt(3), orbit, time_s)


@settings
class ProjectedCircle(Formation):
    """A circle in the local horizontal (y-z) plane: z = 2 x (Ma 2009, section 3.1.6).

    Attributes:
        x0_m: radial position at t = 0, m.
        vx0_m_s: radial velocity at t = 0, m/s.
    """

    kind: Literal["projected_circle"] = "projected_circle"
    x0_m: Coordinate = 0.0
    vx0_m_s: VelocityComponent = 1.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        return closed_ellipse(self.x0_m, self.vx0_m_s, 2.0, orbit, time_s)
