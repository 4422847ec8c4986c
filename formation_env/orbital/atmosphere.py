"""Air density, and how it brings a circular orbit down (Ma 2009, section 2.3.3)."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formation_env.orbital.constants import MU_EARTH, R_EARTH

Array: TypeAlias = NDArray[np.float64]


def exponential_density_kg_m3(
    altitude_m: ArrayLike, reference_density_kg_m3: float, reference_altitude_m: float, scale_height_m: float
) -> Array:
    """Density (...) of an isothermal atmosphere (Ma 2009, eq. 2.30).

    Args:
        altitude_m: heights above the equatorial radius (...), m.
        reference_density_kg_m3: rho_0, the density at the reference altitude.
        reference_altitude_m: h_0.
        scale_height_m: H, over which the density falls by a factor e.
    """
    # rho = rho_0 exp((h_0 - h) / H)
    density: Array = reference_density_kg_m3 * np.exp(
        (reference_altitude_m - np.asarray(altitude_m, float)) / scale_height_m
    )
    return density


def lifetime_s(altitude_m: float, density_kg_m3: float, scale_height_m: float, area_per_mass_m2_kg: float) -> float:
    """Time in which drag brings a circular orbit down, by the estimate of `decayed_altitude_m`, s; inf without drag.

    Args:
        altitude_m: h(0), m.
        density_kg_m3: rho at that altitude, which grows by a factor e for each scale height lost.
        scale_height_m: H.
        area_per_mass_m2_kg: C_d S / m.
    """
    # da/dt = -rho v a C_d S / m = -rho sqrt(mu a) C_d S / m, of which the density alone is taken to vary
    sink_rate_m_s = density_kg_m3 * area_per_mass_m2_kg * math.sqrt(MU_EARTH * (R_EARTH + altitude_m))
    return scale_height_m / sink_rate_m_s if sink_rate_m_s > 0 else math.inf


def decayed_altitude_m(
    times_s: ArrayLike, altitude_m: float, density_kg_m3: float, scale_height_m: float, area_per_mass_m2_kg: float
) -> Array:
    """Altitude (...) of a circular orbit that drag brings down (Ma 2009, eq. 2.31).

    The print has h(t_0) for H in front of the logarithm, and the Earth's radius for the orbit's.

    Args:
        times_s: times since h was `altitude_m` (...), s.
        altitude_m: h(0), m.
        density_kg_m3: rho at that altitude.
        scale_height_m: H.
        area_per_mass_m2_kg: C_d S / m.

    Raises:
        ValueError: a time at which the orbit has come down.
    """
    life_s, times = (
        lifetime_s(altitude_m, density_kg_m3, scale_height_m, area_per_mass_m2_kg),
        np.asarray(times_s, float),
    )
    if not np.all(times < life_s):
        raise ValueError(f"times_s: must be before the end of the orbit at {life_s:.6g} s, got {np.max(times):.6g}")
    # h(t) = H ln[e^(h(0)/H) - C_d S rho_0 e^(h_0/H) sqrt(mu a) t / (m H)] = h(0) + H ln(1 - t / lifetime)
    altitude: Array = altitude_m + scale_height_m * np.log1p(-times / life_s)
    return altitude
