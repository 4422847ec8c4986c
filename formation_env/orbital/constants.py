"""Physical constants of the project, SI (Ma 2009, Table 5.1; Vallado, Fundamentals of Astrodynamics)."""

from typing import Final

MU_EARTH: Final = 3.986004391e14
"""Gravitational parameter of the Earth, m^3/s^2."""

R_EARTH: Final = 6.3781366e6
"""Equatorial radius of the Earth, m."""

J2: Final = 1.08263e-3
"""Second zonal harmonic of the Earth's gravity field."""

OMEGA_EARTH: Final = 7.292115e-5
"""Rotation rate of the Earth, rad/s."""

MU_SUN: Final = 1.32712440018e20
"""Gravitational parameter of the Sun, m^3/s^2."""

MU_MOON: Final = 4.9028001e12
"""Gravitational parameter of the Moon, m^3/s^2."""

AU_M: Final = 1.495978707e11
"""Astronomical unit, m."""
