"""Formations that circle the leader once per orbit."""

import math
from dataclasses import replace
from typing import Literal, TypeVar

from formation_env.formations.base import Formation, closed_ellipse
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate, VelocityComponent
from formation_env.settings import settings

E = TypeVar("E", "XYEllipse", "SpaceCircle", "ProjectedCircle")


def _equal_phases(formation: E, count: int, orbit: Orbit) -> tuple[E, ...]:
    """Formations on the same circle or ellipse, each 1 / count of a turn ahead of the one before."""
    n, x0, vx0 = orbit.mean_motion_rad_s, formation.x0_m, formation.vx0_m_s
    ahead = []
    for i in range(count):
        c, s = math.cos(2 * math.pi * i / count), math.sin(2 * math.pi * i / count)
        ahead.append(replace(formation, x0_m=c * x0 + s * vx0 / n, vx0_m_s=c * vx0 - s * n * x0))
    return tuple(ahead)


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

    def slots(self, count: int, orbit: Orbit) -> tuple[Formation, ...]:
        """Places at equal phases, the first at the given one."""
        return _equal_phases(self, count, orbit)

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

    def slots(self, count: int, orbit: Orbit) -> tuple[Formation, ...]:
        """Places at equal phases, the first at the given one."""
        return _equal_phases(self, count, orbit)

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

    def slots(self, count: int, orbit: Orbit) -> tuple[Formation, ...]:
        """Places at equal phases, the first at the given one."""
        return _equal_phases(self, count, orbit)

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        return closed_ellipse(self.x0_m, self.vx0_m_s, 2.0, orbit, time_s)
