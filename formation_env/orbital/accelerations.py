"""Accelerations of one spacecraft in the inertial frame (ECI), m/s^2.

Each function works on the components: arrays (...) in Python, scalars in compiled code.
"""

from typing import Any, Final

import numpy as np

from formation_env.numerics.jit import python_and_compiled
from formation_env.orbital.constants import AU_M, MU_EARTH, R_EARTH

Components = tuple[Any, Any, Any]
"""x, y, z: floats or arrays (...)."""

SOLAR_PRESSURE_N_M2: Final = 4.56e-6
"""Mean solar radiation pressure at 1 AU, N/m^2."""


@python_and_compiled
def gravity(x: Any, y: Any, z: Any, j2: float) -> Components:
    """Gravity of the oblate Earth (Ma 2009, eq. 2.19-2.21).

    Args:
        x: position, m.
        y: position, m.
        z: position along the Earth's axis, m.
        j2: second zonal harmonic; 0 is a spherical Earth.
    """
    # a = -mu / r^3 [x (1 + q (1 - s)), y (1 + q (1 - s)), z (1 + q (3 - s))], q = 3/2 J2 (R/r)^2, s = 5 (z/r)^2
    per_square = 1.0 / (x * x + y * y + z * z)
    pull = -MU_EARTH * per_square * np.sqrt(per_square)
    q = 1.5 * j2 * R_EARTH * R_EARTH * per_square
    s = 5.0 * z * z * per_square
    equatorial = pull * (1.0 + q * (1.0 - s))
    return equatorial * x, equatorial * y, pull * (1.0 + q * (3.0 - s)) * z


@python_and_compiled
def drag(vx: Any, vy: Any, vz: Any, density: Any, area_per_mass: float) -> Components:
    """Air drag in an atmosphere at rest (Ma 2009, eq. 2.28).

    Args:
        vx: velocity, m/s.
        vy: velocity, m/s.
        vz: velocity, m/s.
        density: of the air, kg/m^3.
        area_per_mass: C_d S / m, m^2/kg.
    """
    # a = -1/2 rho (C_d S / m) |v| v
    factor = -0.5 * density * area_per_mass * np.sqrt(vx * vx + vy * vy + vz * vz)
    return factor * vx, factor * vy, factor * vz


@python_and_compiled
def third_body(x: Any, y: Any, z: Any, bx: Any, by: Any, bz: Any, mu: float) -> Components:
    """Pull of the Sun or the Moon, relative to what it does to the Earth (Ma 2009, eq. 2.34).

    Args:
        x: position, m.
        y: position, m.
        z: position, m.
        bx: position of the body, m.
        by: position of the body, m.
        bz: position of the body, m.
        mu: gravitational parameter of the body, m^3/s^2.
    """
    # a = mu [(b - r) / |b - r|^3 - b / |b|^3]
    dx, dy, dz = bx - x, by - y, bz - z
    per_square = 1.0 / (dx * dx + dy * dy + dz * dz)
    direct = mu * per_square * np.sqrt(per_square)
    per_square = 1.0 / (bx * bx + by * by + bz * bz)
    indirect = mu * per_square * np.sqrt(per_square)
    return direct * dx - indirect * bx, direct * dy - indirect * by, direct * dz - indirect * bz


@python_and_compiled
def radiation_pressure(x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, area_per_mass: float) -> Components:
    """Solar radiation pressure, away from the Sun; no shadow (Ma 2009, eq. 2.41).

    Args:
        x: position, m.
        y: position, m.
        z: position, m.
        sx: position of the Sun, m.
        sy: position of the Sun, m.
        sz: position of the Sun, m.
        area_per_mass: K A / m, m^2/kg.
    """
    # a = -K p A / m (AU / d)^2 d / |d|, d from the spacecraft to the Sun
    dx, dy, dz = sx - x, sy - y, sz - z
    per_square = 1.0 / (dx * dx + dy * dy + dz * dz)
    factor = -SOLAR_PRESSURE_N_M2 * area_per_mass * AU_M * AU_M * per_square * np.sqrt(per_square)
    return factor * dx, factor * dy, factor * dz
