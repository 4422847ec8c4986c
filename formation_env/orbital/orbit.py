"""The leader's orbit."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from formation_env.orbital.constants import J2, MU_EARTH, R_EARTH
from formation_env.orbital.elements import Elements, mean_radius_m
from formation_env.orbital.kepler import mean_to_true, true_to_mean
from formation_env.settings import Flag, Positive, Real, settings

LEAST_ALTITUDE_M = 100e3


@settings(renamed={"reference": "mean_motion_from"})
class Orbit:
    """Low Earth orbit of the leader (Ma 2009, Table 5.1): its osculating elements at t = 0.

    The linear models and the formations live on a Keplerian orbit about which they are linearised. Its mean motion is
    that of the osculating semi-major axis, or, under J2, that of the mean radius: then n c of the modified HCW
    equations is the rate at which the leader really circles the Earth (Schweighart & Sedwick 2002).

    Attributes:
        altitude_m: height of the semi-major axis above the equatorial radius, m.
        eccentricity: eccentricity.
        inclination_deg: inclination, deg.
        raan_deg: right ascension of the ascending node, deg.
        arg_perigee_deg: argument of perigee, deg.
        true_anomaly_deg: true anomaly at t = 0, deg.
        j2: whether the Earth's oblateness acts.
        mean_motion_from: radius that the mean motion is taken of; `mean` needs a circular orbit.
    """

    altitude_m: Annotated[Positive, Field(ge=LEAST_ALTITUDE_M, le=50e6)] = 600e3
    eccentricity: Annotated[Real, Field(ge=0, lt=1)] = 0.0
    inclination_deg: Annotated[Real, Field(ge=0, le=180)] = 60.0
    raan_deg: Real = 0.0
    arg_perigee_deg: Real = 0.0
    true_anomaly_deg: Real = 0.0
    j2: Flag = True
    mean_motion_from: Literal["osculating", "mean"] = "osculating"

    @model_validator(mode="after")
    def _check(self) -> Self:
        perigee_m = self.semi_major_axis_m * (1 - self.eccentricity) - R_EARTH
        if perigee_m < LEAST_ALTITUDE_M:
            raise ValueError(f"eccentricity: the perigee must be above {LEAST_ALTITUDE_M:g} m, got {perigee_m:.6g} m")
        if self.mean_motion_from == "mean" and self.eccentricity > 0:
            raise ValueError(f"mean_motion_from: mean needs eccentricity 0, got {self.eccentricity:g}")
        return self

    @property
    def semi_major_axis_m(self) -> float:
        """Osculating semi-major axis at t = 0, m."""
        return R_EARTH + self.altitude_m

    @property
    def radius_m(self) -> float:
        """Radius (for an ellipse: semi-major axis) of the orbit that linear models are linearised about, m."""
        if self.mean_motion_from == "osculating" or not self.j2:
            return self.semi_major_axis_m
        latitude = math.radians(self.arg_perigee_deg + self.true_anomaly_deg)
        return float(mean_radius_m(self.semi_major_axis_m, self.inclination_rad, latitude))

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
        """Mean inertial speed n r, m/s."""
        return self.mean_motion_rad_s * self.radius_m

    @property
    def inclination_rad(self) -> float:
        """Inclination, rad."""
        return math.radians(self.inclination_deg)

    @property
    def j2_coefficient(self) -> float:
        """J2 if the oblateness acts, else 0."""
        return J2 if self.j2 else 0.0

    @property
    def elements(self) -> Elements:
        """Osculating elements at t = 0."""
        angles = (self.inclination_deg, self.raan_deg, self.arg_perigee_deg, self.true_anomaly_deg)
        return Elements(self.semi_major_axis_m, self.eccentricity, *(math.radians(angle) for angle in angles))

    def true_anomaly_rad(self, times_s: ArrayLike) -> NDArray[np.float64]:
        """Keplerian true anomaly (...) at times (...), s; it grows by 2 pi each period."""
        e = self.eccentricity
        start = true_to_mean(math.radians(self.true_anomaly_deg), e)
        return mean_to_true(start + self.mean_motion_rad_s * np.asarray(times_s, float), e)

    def polar_motion(self, time_s: float) -> tuple[float, float, float]:
        """Keplerian radius, m, radial speed, m/s, and angular rate, rad/s, at a time, s."""
        e, theta = self.eccentricity, float(self.true_anomaly_rad(time_s))
        p = self.radius_m * (1 - e**2)
        rho = 1 + e * math.cos(theta)
        # r = p / rho, r' = sqrt(mu / p) e sin(theta), theta' = sqrt(mu / p^3) rho^2
        return p / rho, math.sqrt(MU_EARTH / p) * e * math.sin(theta), math.sqrt(MU_EARTH / p**3) * rho**2
