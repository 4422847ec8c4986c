"""Forces of the nonlinear truth on one spacecraft."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital import accelerations
from formation_env.orbital.atmosphere import exponential_density_kg_m3
from formation_env.orbital.constants import MU_MOON, MU_SUN, R_EARTH
from formation_env.orbital.orbit import Orbit


@dataclass(frozen=True)
class World:
    """Orbit and forces of the nonlinear truth.

    Attributes:
        orbit: the leader's osculating orbit at t = 0.
        perturbations: what acts beside gravity.
    """

    orbit: Orbit
    perturbations: Perturbations

    def density_kg_m3(self, position: Array, craft: Spacecraft) -> Array:
        """Density of the air (...) at positions (..., 3); a spacecraft states it for the leader's altitude."""
        altitude_m = np.linalg.norm(position, axis=-1) - R_EARTH
        scale_m = self.perturbations.scale_height_m or np.inf
        with np.errstate(over="ignore"):  # far below a small scale height it is inf, which the integrator refuses
            return exponential_density_kg_m3(altitude_m, craft.air_density_kg_m3, self.orbit.altitude_m, scale_m)

    def sun_and_moon(self, times_s: Any) -> tuple[Array, Array]:
        """Their positions (..., 3) at times (...), m."""
        from formation_env.orbital.ephemeris import moon_position_m, sun_position_m  # ERFA is slow to import

        epoch = self.perturbations.epoch_jd
        return sun_position_m(epoch, times_s), moon_position_m(epoch, times_s)

    def acceleration(self, times_s: Any, position: Array, velocity: Array, craft: Spacecraft) -> Array:
        """Acceleration (..., 3) of a spacecraft at times (...), m/s^2.

        Args:
            times_s: times (...), s.
            position: ECI (..., 3), m.
            velocity: ECI (..., 3), m/s.
            craft: its drag and its area.
        """
        (x, y, z), (vx, vy, vz), on = np.moveaxis(position, -1, 0), np.moveaxis(velocity, -1, 0), self.perturbations
        parts = [accelerations.gravity(x, y, z, self.orbit.j2_coefficient)]
        if on.drag:
            density = self.density_kg_m3(position, craft)
            parts.append(accelerations.drag(vx, vy, vz, density, craft.drag_area_per_mass_m2_kg))
        if on.far_bodies:
            (sx, sy, sz), (mx, my, mz) = (np.moveaxis(body, -1, 0) for body in self.sun_and_moon(times_s))
            parts.append(accelerations.third_body(x, y, z, sx, sy, sz, MU_SUN * on.sun))
            parts.append(accelerations.third_body(x, y, z, mx, my, mz, MU_MOON * on.moon))
            area = craft.radiation_area_per_mass_m2_kg * on.radiation_pressure
            parts.append(accelerations.radiation_pressure(x, y, z, sx, sy, sz, area))
        return np.moveaxis(np.array(parts).sum(axis=0), 0, -1)
