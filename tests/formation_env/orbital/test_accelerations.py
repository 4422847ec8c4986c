"""Perturbing accelerations: potentials, textbooks' constants and the ratios that the thesis prints."""

import math

import numpy as np
import oracles
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from formation_env.orbital.accelerations import drag, gravity, radiation_pressure, third_body
from formation_env.orbital.constants import AU_M, MU_MOON, MU_SUN
from formation_env.orbital.elements import Elements, secular_rates, to_cartesian, to_elements
from formation_env.orbital.ephemeris import moon_position_m, sun_position_m
from formation_env.orbital.frames import lvlh_axes

Array = NDArray[np.float64]

GEO_M = 42164e3
GEO_GRAVITY_M_S2 = oracles.MU / GEO_M**2
KILOMETRES = st.floats(3e3, 3e4) | st.floats(-3e4, -3e3)


def test_constants_of_the_sun_and_the_moon() -> None:
    """JPL DE440 (Park et al. 2021): 132712440041.279 and 4902.800118 km^3/s^2; IAU 2012 B2: 149597870700 m."""
    assert pytest.approx(1.32712440041279e20, rel=1e-8) == MU_SUN
    assert pytest.approx(4.902800118e12, rel=1e-6) == MU_MOON
    assert AU_M == 149597870700


@given(KILOMETRES, KILOMETRES, KILOMETRES)
def test_gravity_is_the_gradient_of_its_potential(x_km: float, y_km: float, z_km: float) -> None:
    """U = mu/r [1 - J2 (R/r)^2 (3 sin^2 phi - 1)/2], differentiated with imaginary steps, exact to rounding."""

    def potential(x: complex, y: complex, z: complex) -> complex:
        r = (x**2 + y**2 + z**2) ** 0.5
        return oracles.MU / r * (1 - oracles.J2 * (oracles.R_EARTH / r) ** 2 * (3 * (z / r) ** 2 - 1) / 2)

    position, step = 1e3 * np.array([x_km, y_km, z_km]), 1e-10
    gradient = [potential(*(position + 1j * step * axis)).imag / step for axis in np.eye(3)]
    np.testing.assert_allclose(gravity(*position, oracles.J2), gradient, rtol=1e-12)


def test_oblateness_along_the_lvlh_axes() -> None:
    """Ma 2009, eq. (2.19-2.21): the three components on an inclined circle; rounding of the central term."""
    i, u, r = 1.05, np.linspace(0, 6, 13), 6978137.0
    position, velocity = to_cartesian(Elements(r, 0.0, i, 0.4, 0.0, u))
    pull = [np.stack(gravity(*position.T, j2), axis=-1) for j2 in (oracles.J2, 0.0)]
    found = np.einsum("tij,tj->ti", lvlh_axes(position, velocity), pull[0] - pull[1])
    shape = [1 - 3 * np.sin(i) ** 2 * np.sin(u) ** 2, np.sin(i) ** 2 * np.sin(2 * u), np.sin(2 * i) * np.sin(u)]
    expected = -3 * oracles.MU * oracles.J2 * oracles.R_EARTH**2 / (2 * r**4) * np.stack(shape, axis=-1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_oblateness_turns_the_orbit_at_the_secular_rates() -> None:
    """Node and perigee of a Cartesian flight over 60 revolutions against eq. (2.25-2.26).

    Taken at the mean of the osculating elements: first-order theory, so good to a few J2 (0.5 %).
    """
    start = Elements(7.8e6, 0.1, 0.9, 0.5, 0.3, 0.0)
    times = np.linspace(0, 60 * 2 * math.pi * math.sqrt(7.8e6**3 / oracles.MU), 6000)

    def rates(_: float, state: Array) -> Array:
        return np.concatenate([state[3:], gravity(*state[:3], oracles.J2)])

    flight = solve_ivp(
        rates, (0, times[-1]), np.concatenate(to_cartesian(start)), "DOP853", t_eval=times, rtol=1e-9, atol=1e-3
    )
    path = to_elements(flight.y[:3].T, flight.y[3:].T)
    mean = [float(np.mean(element)) for element in path[:3]]
    expected = secular_rates(*mean)
    slopes = [np.polyfit(times, np.unwrap(angle), 1)[0] for angle in (path.raan_rad, path.arg_perigee_rad)]
    np.testing.assert_allclose(slopes, expected[:2], rtol=5e-3)


@pytest.mark.parametrize(("place", "mu"), [(sun_position_m, MU_SUN), (moon_position_m, MU_MOON)])
def test_third_body_is_the_difference_of_its_pulls(place: object, mu: float) -> None:
    """mu [(b - r)/|b - r|^3 - b/|b|^3] in extended precision; what doubles cancel is 1e-16 of the 6e-3 m/s^2 pull."""
    assert callable(place)
    body = place(2451545.0)
    position = np.array([4e6, -5e6, 3e6])
    b, r = body.astype(np.longdouble), position.astype(np.longdouble)
    expected = mu * ((b - r) / np.sum((b - r) ** 2) ** 1.5 - b / np.sum(b**2) ** 1.5)
    np.testing.assert_allclose(third_body(*position, *body, mu), expected.astype(float), rtol=0, atol=5e-18)


def test_ratios_that_the_thesis_prints() -> None:
    """Ma 2009, eq. (2.37-2.39, 2.42): parts of the Earth's pull on a geostationary satellite, to the printed digits.

    Its (m/m_E)(r/d)^3 is the tide of a body at right angles, in its leading term, linear in r: so the force is taken a
    hundred times nearer to the Earth, which leaves the second order out. With the Moon's mean distance the print is
    0.4 % high. J2 is that in the equator's plane. The radiation ratio names no satellite; K A / m = 0.1 m^2/kg has it.
    """
    here = (GEO_M, 0.0, 0.0)

    def part(accel: tuple[float, float, float]) -> float:
        return float(np.linalg.norm(accel)) / GEO_GRAVITY_M_S2

    near = (GEO_M / 100, 0.0, 0.0)
    assert 100 * part(third_body(*near, 0.0, AU_M, 0.0, MU_SUN)) == pytest.approx(0.75e-5, abs=0.005e-5)
    assert 100 * part(third_body(*near, 0.0, 384400e3, 0.0, MU_MOON)) == pytest.approx(1.63e-5, abs=0.01e-5)
    oblate = np.subtract(gravity(*here, oracles.J2), gravity(*here, 0.0))
    assert part(tuple(oblate)) == pytest.approx(3.7e-5, abs=0.05e-5)
    assert part(radiation_pressure(*here, AU_M, 0.0, 0.0, 0.1)) == pytest.approx(0.2e-5, abs=0.05e-5)


def test_drag_brakes() -> None:
    """1/2 rho v^2 C_d S / m against the velocity, 9.4e-9 m/s^2 for the thesis's follower at 7.5 km/s (eq. 2.28)."""
    velocity = np.array([3e3, -4e3, 5.6e3])
    speed = math.sqrt(3e3**2 + 4e3**2 + 5.6e3**2)
    found = np.array(drag(*velocity, 1.04e-13, 1 / 312.5))
    np.testing.assert_allclose(found, -0.5 * 1.04e-13 * speed**2 / 312.5 * velocity / speed, rtol=1e-14)
    assert float(np.linalg.norm(found)) == pytest.approx(9.4e-9, abs=0.05e-9)


def test_sunlight_pushes_away_and_fades_with_the_square() -> None:
    """4.56e-6 N/m^2 at one astronomical unit (Montenbruck & Gill 2000, section 3.4), a quarter of it at two."""
    near = radiation_pressure(0.0, 0.0, 0.0, 0.0, AU_M, 0.0, 0.02)
    np.testing.assert_allclose(near, [0, -4.56e-6 * 0.02, 0], rtol=1e-12)
    far = radiation_pressure(0.0, -AU_M, 0.0, 0.0, AU_M, 0.0, 0.02)
    np.testing.assert_allclose(far, [0, -4.56e-6 * 0.02 / 4, 0], rtol=1e-12)


def test_forces_take_arrays() -> None:
    """A batch (2, 3) gives the same as each of its elements alone."""
    x, y, z = 7e6 + np.arange(6.0).reshape(2, 3), np.full((2, 3), 1e6), np.full((2, 3), -2e6)
    for batch, one in zip(gravity(x, y, z, oracles.J2), gravity(x[1, 2], 1e6, -2e6, oracles.J2), strict=True):
        assert batch.shape == (2, 3)
        assert batch[1, 2] == one
