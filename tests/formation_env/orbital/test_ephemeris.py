"""Sun and Moon against almanacs' worked examples.

These give places by the mean equator and equinox of the date; ERFA's precession brings ours there.
"""

from collections.abc import Callable

import erfa
import numpy as np
import pytest
from numpy.typing import NDArray

from formation_env.orbital.ephemeris import moon_position_m, sun_position_m

Array = NDArray[np.float64]

AU_M = 149597870700.0
J2000 = 2451545.0


def ecliptic_of_date(position: Array, julian_date: float) -> tuple[float, float, float]:
    """Longitude and latitude, deg, and distance, m."""
    x, y, z = erfa.ecm06(julian_date, 0.0) @ position
    return float(np.degrees(np.arctan2(y, x))) % 360, float(np.degrees(np.arctan2(z, np.hypot(x, y)))), np.hypot(x, y)


def test_sun_of_meeus() -> None:
    """Meeus 1998, example 25.b, 1992 October 13.0 TD: apparent 199 deg 54' 21.56'', 0.72'', 0.99760853 AU.

    His nutation (15.908'') and aberration (-20.4955'' / R) come off; a tenth of an arc second is what is left of
    differences between VSOP87 and VSOP2000 and in the precession.
    """
    date = 2448908.5
    longitude, latitude, distance = ecliptic_of_date(sun_position_m(date), date)
    apparent = 199 + 54 / 60 + 21.56 / 3600
    assert longitude == pytest.approx(apparent + (20.4955 / 0.99760853 - 15.908) / 3600, abs=0.1 / 3600)
    assert latitude == pytest.approx(0.72 / 3600, abs=0.1 / 3600)
    assert distance / AU_M == pytest.approx(0.99760853, abs=2e-8)


def test_moon_of_meeus() -> None:
    """Meeus 1998, example 47.a, 1992 April 12.0 TD: 133.162655 deg, -3.229126 deg, 368409.7 km.

    His longitude contains -0.70'' of light time, which ERFA leaves out (moon98, notes); else the same series.
    """
    date = 2448724.5
    position = moon_position_m(date)
    longitude, latitude, _ = ecliptic_of_date(position, date)
    assert longitude == pytest.approx(133.162655 + 0.70 / 3600, abs=5e-5)
    assert latitude == pytest.approx(-3.229126, abs=5e-5)
    assert np.linalg.norm(position) == pytest.approx(368409.7e3, abs=100)


# position, Julian date and published ECI km of Vallado 2013, examples 5-1 and 5-3; his series are good to
# 0.01 deg and 2e-5 (aberration included) and to 0.3 deg and 0.1 % (he says 0.3 deg, 0.2 deg and 0.003 deg of parallax)
VALLADO = {
    "sun": (sun_position_m, 2453827.5, [146186212, 28788976, 12481064], 0.01, 3e-5),
    "moon": (moon_position_m, 2449470.5, [-134240.611, -311571.590, -126693.785], 0.3, 3e-3),
}


@pytest.mark.parametrize("body", VALLADO)
def test_places_of_vallado(body: str) -> None:
    """Direction and distance, to the accuracy of the textbook's short series."""
    place, date, expected_km, angle_deg, ratio = VALLADO[body]
    found = erfa.pmat06(date, 0.0) @ place(date) / 1e3
    distance, expected = np.linalg.norm(found), np.linalg.norm(expected_km)
    assert np.degrees(np.arccos(found @ expected_km / distance / expected)) < angle_deg
    assert distance == pytest.approx(expected, rel=ratio)


@pytest.mark.parametrize(("place", "speed_m_s"), [(sun_position_m, 30.3e3), (moon_position_m, 1.0e3)])
def test_elapsed_time_is_fine_grained(place: Callable[..., Array], speed_m_s: float) -> None:
    """Steps of 1 ms, lost in a Julian date of 40 microseconds' grain, move a body evenly at its mean speed (10 %).

    The Moon's distance of 4e8 m and the Sun's of 1.5e11 m are doubles of 6e-8 m and 3e-5 m grain, and their angles of
    a few times that.
    """
    path = place(J2000, np.arange(5) * 1e-3)
    assert path.shape == (5, 3)
    np.testing.assert_allclose(np.linalg.norm(np.diff(path, axis=0), axis=1), speed_m_s * 1e-3, rtol=0.1)
    np.testing.assert_allclose(place(J2000, 86400.0), place(J2000 + 1), rtol=1e-12)
