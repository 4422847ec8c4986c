"""Elements, anomalies and the mean motion under J2, against SPICE and published examples."""

import math

import numpy as np
import oracles
import pytest
import spiceypy
from hypothesis import given
from hypothesis import strategies as st

from formation_env.orbital.elements import (
    Elements,
    mean_radius_m,
    orbital_axes,
    secular_rates,
    to_cartesian,
    to_elements,
)
from formation_env.orbital.kepler import eccentric_to_true, mean_to_true, solve_kepler, true_to_eccentric, true_to_mean

ANGLE = st.floats(0, 6.28)
ELEMENTS = st.builds(Elements, st.floats(6.6e6, 5e7), st.floats(0, 0.9), st.floats(0, math.pi), ANGLE, ANGLE, ANGLE)
# No angle is undefined, or so nearly that it is the rounding of the state that decides.
REGULAR = st.builds(Elements, st.floats(6.6e6, 5e7), st.floats(1e-3, 0.9), st.floats(1e-3, 3.14), ANGLE, ANGLE, ANGLE)


def assert_angles_equal(actual: object, expected: object, atol: float) -> None:
    """Angles that may differ by whole turns."""
    turns = np.subtract(actual, expected) / (2 * math.pi)
    np.testing.assert_allclose(turns - np.round(turns), 0, atol=atol / (2 * math.pi))


@given(st.floats(-50, 50), st.floats(0, 1, exclude_max=True))
def test_kepler_equation_is_solved(mean: float, e: float) -> None:
    """E - e sin E = M up to the nearly parabolic; rounding of terms of up to 50."""
    E = solve_kepler(mean, e)
    assert E - e * math.sin(E) == pytest.approx(mean, rel=1e-15, abs=3e-14)


def test_kepler_equation_near_a_parabola() -> None:
    """Where a plain Newton iteration runs away: e -> 1 with M -> 0; there E -> cbrt(6 M), up to its square."""
    M = np.geomspace(1e-18, 1e-9, 10)
    np.testing.assert_allclose(solve_kepler(M, 1 - 1e-15), np.cbrt(6 * M), rtol=1e-3)


def test_kepler_equation_is_solved_all_over() -> None:
    """A dense grid of half a revolution and up to e = 1 - 1e-15 has no gap; rounding of terms of up to pi."""
    M, e = np.meshgrid(np.geomspace(1e-12, math.pi, 300), 1 - np.geomspace(1e-15, 1, 100))
    E = solve_kepler(M, e)
    np.testing.assert_allclose(E - e * np.sin(E), M, rtol=0, atol=2e-15)


def test_kepler_equation_against_spice() -> None:
    """The solver of NASA's SPICE, on a grid; both solve to rounding, which 1 - e = 0.11 enlarges tenfold."""
    M, e = np.meshgrid(np.linspace(-7, 7, 15), [0.0, 0.1, 0.5, 0.89])
    expected = np.vectorize(lambda mean, k: spiceypy.kepleq(mean, 0.0, k))(M, e)
    np.testing.assert_allclose(solve_kepler(M, e), expected, rtol=0, atol=1e-13)


def test_kepler_equation_of_a_textbook() -> None:
    """Vallado 2013, example 2-1: M = 235.4 deg, e = 0.4 gives E = 220.512074767522 deg, all digits."""
    assert math.degrees(solve_kepler(math.radians(235.4), 0.4)) == pytest.approx(220.512074767522, abs=1e-11)


@given(st.floats(-20, 20), st.floats(0, 0.99))
def test_anomalies_invert_each_other_in_their_own_revolution(nu: float, e: float) -> None:
    """True -> eccentric -> true and true -> mean -> true; rounding grows by ((1 + e)/(1 - e))^1.5."""
    assert eccentric_to_true(true_to_eccentric(nu, e), e) == pytest.approx(nu, abs=1e-12)
    assert mean_to_true(true_to_mean(nu, e), e) == pytest.approx(nu, abs=1e-10)
    assert abs(true_to_mean(nu, e) - nu) < math.pi


@pytest.mark.parametrize("e", [0.0, 0.3, 0.95])
def test_true_anomaly_is_the_direction_on_the_ellipse(e: float) -> None:
    """From the focus a point is at (cos E - e, sqrt(1 - e^2) sin E); rounding, larger where it is near."""
    E = np.linspace(-3.1, 3.1, 30)
    direction = np.arctan2(np.sqrt(1 - e**2) * np.sin(E), np.cos(E) - e)
    np.testing.assert_allclose(eccentric_to_true(E, e), direction, rtol=0, atol=1e-13)


@pytest.mark.parametrize("e", [1.0, -0.1, math.nan])
def test_orbits_that_are_not_ellipses_are_refused(e: float) -> None:
    """Each way in names the argument and the value."""
    message = rf"eccentricity: must be in \[0, 1\), got {e}"
    for call in (solve_kepler, mean_to_true, true_to_mean):
        with pytest.raises(ValueError, match=message):
            call(1.0, [0.5, e])
    with pytest.raises(ValueError, match=message):
        to_cartesian(Elements(7e6, e, 1.0, 0.0, 0.0, 0.0))


@given(ELEMENTS)
def test_cartesian_state_is_that_of_spice(elements: Elements) -> None:
    """spiceypy.conics, by the mean anomaly; 1e-12 of the orbit's size and speed, times 1/(1 - e)."""
    a, e, i, raan, arg_perigee, nu = elements
    M = float(true_to_mean(nu, e))
    expected = spiceypy.conics([a * (1 - e), e, i, raan, arg_perigee, M, 0, oracles.MU], 0)
    position, velocity = to_cartesian(elements)
    np.testing.assert_allclose(position, expected[:3], rtol=0, atol=1e-11 * a)
    np.testing.assert_allclose(velocity, expected[3:], rtol=0, atol=1e-10 * math.sqrt(oracles.MU / a))


@given(REGULAR)
def test_elements_are_those_of_spice(elements: Elements) -> None:
    """spiceypy.oscelt on the same state; e = 1e-3 and i = 1e-3 magnify rounding of 1e-15 to 1e-12 in the angles."""
    position, velocity = to_cartesian(elements)
    rp, e, i, raan, arg_perigee, M, *_ = spiceypy.oscelt(np.concatenate([position, velocity]), 0, oracles.MU)
    found = to_elements(position, velocity)
    np.testing.assert_allclose(found[:3], [rp / (1 - e), e, i], rtol=1e-11, atol=1e-11)
    assert_angles_equal(found[3:5], [raan, arg_perigee], atol=1e-10)
    assert_angles_equal(true_to_mean(found.true_anomaly_rad, e), M, atol=1e-10)


def test_elements_of_a_textbook() -> None:
    """Vallado 2013, example 2-5, to its printed digits (its mu differs by 3e-9)."""
    found = to_elements([6524.834e3, 6862.875e3, 6448.296e3], [4.901327e3, 5.533756e3, -1.976341e3])
    assert found.semi_major_axis_m == pytest.approx(36127.343e3, abs=5)
    assert found.eccentricity == pytest.approx(0.832853, abs=1e-6)
    np.testing.assert_allclose(np.degrees(found[2:]), [87.870, 227.898, 53.38, 92.335], rtol=0, atol=6e-3)


@given(ELEMENTS)
def test_states_survive_the_round_trip(elements: Elements) -> None:
    """State -> elements -> state on every ellipse; what `UNDEFINED` calls rounding costs 1e-13 of the radius."""
    position, velocity = to_cartesian(elements)
    back, back_velocity = to_cartesian(to_elements(position, velocity))
    a = float(elements.semi_major_axis_m)
    np.testing.assert_allclose(back, position, rtol=0, atol=1e-12 * a)
    np.testing.assert_allclose(back_velocity, velocity, rtol=0, atol=3e-11 * math.sqrt(oracles.MU / a))


# elements with an undefined angle -> (raan, argument of perigee, true anomaly) by the usual conventions
CONVENTIONS = {
    "circular": (Elements(7e6, 0.0, 1.0, 0.5, 0.3, 0.4), (0.5, 0.0, 0.7)),
    "equatorial": (Elements(7e6, 0.1, 0.0, 0.5, 0.3, 0.4), (0.0, 0.8, 0.4)),
    "equatorial, backwards": (Elements(7e6, 0.1, math.pi, 0.5, 0.3, 0.4), (0.0, -0.2, 0.4)),
    "circular and equatorial": (Elements(7e6, 0.0, 0.0, 0.5, 0.3, 0.4), (0.0, 0.0, 1.2)),
}


@pytest.mark.parametrize("name", CONVENTIONS)
def test_undefined_angles_are_zero_and_the_next_takes_over(name: str) -> None:
    """Argument of latitude, longitude of perigee, true longitude; on a backward equator angles count backwards."""
    elements, expected = CONVENTIONS[name]
    found = to_elements(*to_cartesian(elements))
    assert_angles_equal(found[3:], expected, atol=1e-14)
    zero = [angle == 0 for angle in found[3:]]
    assert zero == [angle == 0 for angle in expected]


def test_angles_stay_below_a_turn() -> None:
    """Just before perigee, the node and the x axis: an angle of -1e-20 rounds to a whole turn, which is 0."""
    position, velocity = to_cartesian(Elements(7e6, 0.1, 0.5, 0.0, 0.0, 0.0))
    found = np.array(to_elements(position - [0, 1e-13, 0], velocity)[3:])
    assert np.all((found >= 0) & (found < 2 * math.pi))


def test_elements_take_any_leading_shape() -> None:
    """A grid (2, 1) of axes against (3,) of eccentricities: states (2, 3, 3), and each one as alone."""
    a, e = np.array([[7e6], [8e6]]), np.array([0.0, 0.1, 0.2])
    position, velocity = to_cartesian(Elements(a, e, 1.0, 0.5, 0.3, 0.4))
    assert position.shape == velocity.shape == (2, 3, 3)
    np.testing.assert_array_equal(position[1, 2], to_cartesian(Elements(8e6, 0.2, 1.0, 0.5, 0.3, 0.4))[0])
    assert all(np.shape(field) == (2, 3) for field in to_elements(position, velocity))
    assert orbital_axes(Elements(a, e, 1.0, 0.5, 0.3, 0.4)).shape == (2, 3, 3, 3)


@pytest.mark.parametrize("velocity", [[0.0, 12e3, 0.0], [1e3, 0.0, 0.0], [math.nan, 7e3, 0.0]])
def test_states_that_are_not_on_an_ellipse_are_refused(velocity: list[float]) -> None:
    """Faster than escape, straight up, and not a number."""
    with pytest.raises(ValueError, match="must be on an elliptic orbit"):
        to_elements([[7e6, 0, 0], [7e6, 0, 0]], [[0, 7.5e3, 0], velocity])


def averaged_j2_potential(a: float, e: float, i: float) -> float:
    """Mean over the mean anomaly of R = mu J2 R_E^2 / (2 r^3) (1 - 3 sin^2 i sin^2 u), by quadrature."""
    nu = np.linspace(0, 2 * math.pi, 64, endpoint=False)
    r = a * (1 - e**2) / (1 + e * np.cos(nu))
    potential = oracles.MU * oracles.J2 * oracles.R_EARTH**2 / (2 * r**3) * (1 - 3 * (math.sin(i) * np.sin(nu)) ** 2)
    # dM = (r / a)^2 / sqrt(1 - e^2) d nu
    return float(np.mean(potential * (r / a) ** 2) / math.sqrt(1 - e**2))


@pytest.mark.parametrize(("a", "e", "i"), [(6.98e6, 0.01, 1.05), (2.66e7, 0.74, 1.1), (8e6, 0.15, 2.6)])
def test_secular_rates_are_those_of_the_averaged_potential(a: float, e: float, i: float) -> None:
    """Lagrange's planetary equations on a numerical average and its central differences (1e-7 in relative terms)."""
    n, root, step = math.sqrt(oracles.MU / a**3), math.sqrt(1 - e**2), 1e-5
    by_a = (averaged_j2_potential(a * (1 + step), e, i) - averaged_j2_potential(a * (1 - step), e, i)) / (2 * step * a)
    by_e = (averaged_j2_potential(a, e + step, i) - averaged_j2_potential(a, e - step, i)) / (2 * step)
    by_i = (averaged_j2_potential(a, e, i + step) - averaged_j2_potential(a, e, i - step)) / (2 * step)
    rates = secular_rates(a, e, i)
    raan_rate = by_i / (n * a**2 * root * math.sin(i))
    assert rates.raan_rad_s == pytest.approx(raan_rate, rel=1e-7)
    assert rates.arg_perigee_rad_s == pytest.approx(root / (n * a**2 * e) * by_e - math.cos(i) * raan_rate, rel=1e-6)
    mean_rate = -(root**2) / (n * a**2 * e) * by_e - 2 / (n * a) * by_a
    assert rates.mean_anomaly_rad_s - n == pytest.approx(mean_rate, rel=1e-6)


def test_a_sun_synchronous_orbit_turns_once_a_year() -> None:
    """Boain 2004: cos i = -(a / 12352 km)^3.5 on a circular orbit; four digits of that constant, times 3.5."""
    a = np.array([6.8e6, 7.2e6, 7.6e6])
    rates = secular_rates(a, 0.0, np.arccos(-((a / 12352e3) ** 3.5)))
    np.testing.assert_allclose(rates.raan_rad_s, 2 * math.pi / (365.2422 * 86400), rtol=3e-4)


def test_without_oblateness_only_the_mean_anomaly_moves() -> None:
    """J2 = 0 leaves Kepler's motion, at n of the leader of Ma 2009 (printed 1.08308e-3 rad/s)."""
    rates = secular_rates(6978136.6, 0.0, 1.0, j2=0.0)
    assert (rates.raan_rad_s, rates.arg_perigee_rad_s) == (0, 0)
    assert rates.mean_anomaly_rad_s == pytest.approx(1.08308e-3, abs=5e-9)
    assert mean_radius_m(7e6, 1.0, 0.3, j2=0.0) == 7e6


@pytest.mark.parametrize("inclination_deg", [10.0, 60.0, 97.0])
def test_mean_radius_gives_the_mean_rate(inclination_deg: float) -> None:
    """n c at the mean radius is the rate at which a leader flown under J2 turns about its orbit normal.

    That rate is u' + RAAN' cos i, measured over whole nodal revolutions of a Cartesian flight. Order J2^2 is left out,
    a few 1e-6; with the osculating radius the rate would be off by 1e-3.
    """
    i, a, revolutions = math.radians(inclination_deg), 6978137.0, 30
    times, states = oracles.fly_under_j2(revolutions, i, a)
    h = np.cross(states[:3], states[3:], axis=0)
    nodes = np.unwrap(np.arctan2(h[0], -h[1]))
    nodal_rate = (nodes[-1] - nodes[0]) / (times[-1] - times[0])
    latitude_rate = 2 * math.pi * revolutions / (times[-1] - times[0])

    def rate(radius_m: float) -> float:
        s = 3 * oracles.J2 * oracles.R_EARTH**2 / (8 * radius_m**2) * (1 + 3 * math.cos(2 * i))
        return math.sqrt(oracles.MU / radius_m**3 * (1 + s))

    expected = latitude_rate + nodal_rate * math.cos(i)
    assert rate(float(mean_radius_m(a, i, 0.0))) == pytest.approx(expected, rel=1e-5)


def test_mean_radius_of_the_thesis_leader() -> None:
    """The independent simulation's README: 6972.235 km fits its leader; first-order theory is 2e-6 off in radius."""
    assert mean_radius_m(6978137.0, math.radians(60), 0.0) == pytest.approx(6972235.0, rel=3e-6)
