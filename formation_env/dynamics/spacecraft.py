"""A spacecraft: its drag and its thruster."""

from formation_env.quantities import (
    Acceleration,
    AirDensity,
    Area,
    Coefficient,
    Mass,
    PositiveAcceleration,
    ThrustNoise,
)
from formation_env.settings import settings


@settings
class Spacecraft:
    """Mass, drag and thruster of one spacecraft (Ma 2009, Table 5.2).

    Attributes:
        mass_kg: mass, kg.
        area_m2: cross-section normal to the flight direction, m^2.
        drag_coefficient: C_d.
        air_density_kg_m3: density of the air it flies through, kg/m^3.
        radiation_coefficient: K of the solar radiation pressure: 1 absorbs the light, 2 reflects it straight back.
        max_accel_m_s2: greatest thrust acceleration along each LVLH axis, m/s^2.
        min_accel_m_s2: a commanded acceleration whose magnitude is below this fires nothing, m/s^2.
        thrust_noise: 1-sigma of the relative error of the thrust's magnitude, drawn anew each step.
    """

    mass_kg: Mass = 50.0
    area_m2: Area = 0.16
    drag_coefficient: Coefficient = 1.0
    air_density_kg_m3: AirDensity = 1.04e-13
    radiation_coefficient: Coefficient = 1.0
    max_accel_m_s2: PositiveAcceleration = 0.1
    min_accel_m_s2: Acceleration = 0.0
    thrust_noise: ThrustNoise = 0.0

    @property
    def drag_area_per_mass_m2_kg(self) -> float:
        """Inverse ballistic coefficient C_d S / m = 1 / B, m^2/kg (finite without drag, too)."""
        return self.drag_coefficient * self.area_m2 / self.mass_kg

    @property
    def radiation_area_per_mass_m2_kg(self) -> float:
        """K S / m, m^2/kg: solar radiation pressure times this is an acceleration."""
        return self.radiation_coefficient * self.area_m2 / self.mass_kg

    @property
    def drag_rate_per_speed(self) -> float:
        """rho / B, 1/m: drag deceleration is half of this times the speed squared."""
        return self.air_density_kg_m3 * self.drag_area_per_mass_m2_kg
