"""Positions of the Sun and the Moon in ECI, for gravity and radiation pressure (Ma 2009, eq. 2.34-2.41).

Axes are those of the mean equator and equinox J2000 (GCRS). Dates outside 1900-2100 make ERFA warn.
"""

from typing import TypeAlias

import erfa
import numpy as np
from numpy.typing import ArrayLike, NDArray

from formation_env.orbital.constants import AU_M

Array: TypeAlias = NDArray[np.float64]

DAY_S = 86400.0


def sun_position_m(julian_date: ArrayLike, elapsed_s: ArrayLike = 0.0) -> Array:
    """Geometric position of the Sun (VSOP2000 by ERFA's epv00: 11 km off DE405 at worst, 1900-2100).

    Args:
        julian_date: an epoch (...), TDB, days.
        elapsed_s: time since then (...), s; apart from the date, as a double holds that to 40 microseconds only.

    Returns:
        Position (..., 3), m.
    """
    heliocentric, _ = erfa.epv00(*_date(julian_date, elapsed_s))
    position: Array = -AU_M * heliocentric["p"]
    return position


def moon_position_m(julian_date: ArrayLike, elapsed_s: ArrayLike = 0.0) -> Array:
    """Position of the Moon (Meeus 1998, chapter 47, by ERFA's moon98: 32 km off ELP/MPP02 at worst, 1950-2100).

    Args:
        julian_date: an epoch (...), TDB, days.
        elapsed_s: time since then (...), s.

    Returns:
        Position (..., 3), m.
    """
    position: Array = AU_M * erfa.moon98(*_date(julian_date, elapsed_s))["p"]
    return position


def _date(julian_date: ArrayLike, elapsed_s: ArrayLike) -> tuple[Array, Array]:
    """The two parts of a date that ERFA adds without loss, days."""
    return np.asarray(julian_date, float), np.asarray(elapsed_s, float) / DAY_S
