"""The leader's orbit."""

import math
from typing import Annotated

from pydantic import Field

from formation_env.constants import J2, MU_EARTH, R_EARTH
from formation_env.settings import Flag, Positive, Real, settings


@settings
class Orbit:
    """Circular low Earth orbit of the leader (Ma 2009, Table 5.1).

    Attributes:
        altitude_m: height above the equatorial radius, m.
        inclination_deg: inclination, deg.
        raan_deg: right ascension of the ascending node, deg.
        arg_perigee_deg: argument of perigee, deg.
        true_anomaly_deg: true anomaly at t = 0, deg.
        j2: whether the Earth's oblateness acts.
    """

    altitude_m: Annotated[Positive, Field(ge=100e3, le=50e6)] = 600e3
    inclination_deg: Annotated[Real, Field(ge=0, le=180)] = 60.0
    raan_deg: Real = 0.0
    arg_perigee_deg: Real = 0.0
    true_anomaly_deg: Real = 0.0
    j2: Flag = True

    @property
    def radius_m(self) -> float:
        """Distance from the Earth's centre, m."""
        return R_EARTH + self.altitude_m

    @property
    def mean_motion_rad_s(self) -> float:
        """Keplerian mean motion sqrt(mu / r^3), rad/s."""
        return math.sqrt(MU_EARTH / self.radius_m**3)

    @property
    def period_s(self) -> float:
        """Keplerian period, s."""
        return 2 * math.pi / self.mean_motion_rad_s

    @property
    def speed_m_s(self) -> float:
        """Inertial speed n r, m/s."""
        return self.mean_motion_rad_s * self.radius_m

    @property
    def inclination_rad(self) -> float:
        """Inclination, rad."""
        return math.radians(self.inclination_deg)

    @property
    def j2_coefficient(self) -> float:
        """J2 if the oblateness acts, else 0."""
        return J2 if self.j2 else 0.0
