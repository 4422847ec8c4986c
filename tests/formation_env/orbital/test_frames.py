"""Reference frames against SPICE, and LVLH against the independent simulation."""

import math

import numpy as np
import oracles
import pytest
import spiceypy
import truth
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from formation_env.orbital.elements import Elements, to_cartesian
from formation_env.orbital.frames import (
    cartesian_to_spherical,
    earth_fixed_to_eci,
    eci_to_earth_fixed,
    eci_to_lvlh,
    eci_to_orbital,
    lvlh_axes,
    lvlh_to_eci,
    orbital_to_eci,
    spherical_to_cartesian,
)

Array = NDArray[np.float64]

OMEGA_EARTH = 7.292115e-5
ANGLE = st.floats(0, 6.28)
LEADERS = st.builds(Elements, st.floats(6.6e6, 5e7), st.floats(0, 0.8), st.floats(0, math.pi), ANGLE, ANGLE, ANGLE)
METRES = hnp.arrays(float, 3, elements=st.floats(-1e5, 1e5))
SPEEDS = hnp.arrays(float, 3, elements=st.floats(-100, 100))
LEADER = Elements(6978137.0, 0.1, 1.0, 0.5, 0.7, 2.0)


def gravity(position: Array) -> Array:
    """Acceleration by the point mass and J2 (Vallado 2013, section 8.6.1)."""
    r = np.linalg.norm(position)
    q = 1.5 * oracles.J2 * (oracles.R_EARTH / r) ** 2
    return -oracles.MU / r**3 * position * (1 + q * (np.array([1, 1, 3]) - 5 * (position[2] / r) ** 2))


@given(LEADERS, METRES, SPEEDS, st.floats(-0.1, 0.1))
def test_lvlh_is_undone(elements: Elements, offset: Array, rate: Array, push: float) -> None:
    """LVLH -> ECI -> LVLH; rounding of positions of 5e7 m (1e-8 m) and speeds of 1e4 m/s."""
    leader = to_cartesian(elements)
    found = eci_to_lvlh(*lvlh_to_eci(offset, rate, *leader, push), *leader, push)
    np.testing.assert_allclose(found[0], offset, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found[1], rate, rtol=0, atol=1e-9)


@given(LEADERS, METRES, SPEEDS)
def test_lvlh_is_the_turning_frame_of_spice(elements: Elements, offset: Array, rate: Array) -> None:
    """spiceypy.twovxf differentiates the axes along the leader's motion, here with J2, which also tilts the orbit."""
    position, velocity = to_cartesian(elements)
    accel = gravity(position)
    states = np.concatenate([position, velocity]), np.concatenate([velocity, accel])
    matrix = np.array(spiceypy.twovxf(states[0], 1, states[1], 2))
    expected = matrix @ np.concatenate([offset, rate])
    normal_accel = float(lvlh_axes(position, velocity)[2] @ accel)
    found = eci_to_lvlh(position + offset, velocity + rate, position, velocity, normal_accel)
    np.testing.assert_allclose(found[0], expected[:3], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found[1], expected[3:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("case", truth.CASES)
def test_lvlh_is_that_of_the_independent_simulation(case: str) -> None:
    """Leader and follower flown under J2 from the file's first row meet its rows over one orbit.

    Both integrators leave 1e-4 m; a frame that did not tilt would be off by millimetres per second.
    """
    times, rows = truth.load(case, "j2")
    times, rows = times[times <= truth.PERIOD_S], rows[times <= truth.PERIOD_S]
    leader = to_cartesian(Elements(6978137.0, 0.0, math.radians(60), 0.0, 0.0, 0.0))
    # at t = 0 the leader is over the equator, where J2 does not push it out of its plane
    follower = lvlh_to_eci(rows[0, :3], rows[0, 3:], *leader)

    def flight(start: tuple[Array, Array]) -> Array:
        rates = lambda _, s: np.concatenate([s[3:], gravity(s[:3])])  # noqa: E731
        span = (0, times[-1])
        return solve_ivp(rates, span, np.concatenate(start), "DOP853", t_eval=times, rtol=1e-13, atol=1e-8).y.T

    (r0, v0), (r1, v1) = (np.split(flight(start), 2, axis=1) for start in (leader, follower))
    push = np.einsum("ti,ti->t", lvlh_axes(r0, v0)[:, 2], np.apply_along_axis(gravity, 1, r0))
    position, velocity = eci_to_lvlh(r1, v1, r0, v0, push)
    np.testing.assert_allclose(position, rows[:, :3], rtol=0, atol=1e-3)
    np.testing.assert_allclose(velocity, rows[:, 3:], rtol=0, atol=1e-6)


@given(LEADERS, st.floats(-1e5, 1e5), ANGLE)
def test_earth_fixed_is_the_turning_frame_of_spice(elements: Elements, time: float, angle: float) -> None:
    """spiceypy.eul2xf: a state transformation that turns about z at the Earth's rate; rounding."""
    state = to_cartesian(elements)
    turn = [angle + OMEGA_EARTH * time, 0, 0, OMEGA_EARTH, 0, 0]
    expected = np.array(spiceypy.eul2xf(turn, 3, 1, 3)) @ np.concatenate(state)
    found = eci_to_earth_fixed(*state, time, angle)
    np.testing.assert_allclose(found[0], expected[:3], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found[1], expected[3:], rtol=0, atol=1e-9)
    back = earth_fixed_to_eci(*found, time, angle)
    np.testing.assert_allclose(back[0], state[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(back[1], state[1], rtol=0, atol=1e-9)


def test_a_geostationary_satellite_stands_still() -> None:
    """On the equator at the Earth's own rate: the Earth-fixed state stays, with no velocity (rounding of 3 km/s)."""
    times = np.linspace(0, 86400, 7)
    radius = (oracles.MU / OMEGA_EARTH**2) ** (1 / 3)
    position, velocity = to_cartesian(Elements(radius, 0.0, 0.0, 0.0, 0.0, OMEGA_EARTH * times + 0.3))
    fixed, rate = eci_to_earth_fixed(position, velocity, times, 0.3)
    np.testing.assert_allclose(fixed, np.tile([radius, 0, 0], (7, 1)), rtol=0, atol=1e-6)
    np.testing.assert_allclose(rate, 0, atol=1e-9)


@given(st.builds(Elements, st.floats(6.6e6, 5e7), st.floats(0, 0.8), st.floats(0.1, 1.3), ANGLE, ANGLE, ANGLE))
def test_spherical_coordinates_are_those_of_spice(elements: Elements) -> None:
    """spiceypy.xfmsta to LATITUDINAL (radius, longitude, latitude and rates) and back; rounding."""
    state = to_cartesian(elements)
    expected = spiceypy.xfmsta(np.concatenate(state), "RECTANGULAR", "LATITUDINAL", " ")
    coordinates, rates = cartesian_to_spherical(*state)
    np.testing.assert_allclose(coordinates, expected[:3], rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(rates[0], expected[3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(rates[1:], expected[4:], rtol=1e-12, atol=1e-16)
    back = spherical_to_cartesian(coordinates, rates)
    np.testing.assert_allclose(back[0], state[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(back[1], state[1], rtol=0, atol=1e-9)


def test_the_poles_have_no_longitude() -> None:
    """Right over a pole the rates are undefined, and one of a batch is enough."""
    with pytest.raises(ValueError, match="off the polar axis"):
        cartesian_to_spherical([[7e6, 0, 0], [0, 0, 7e6]], [[0, 7e3, 0], [7e3, 0, 0]])


@given(LEADERS)
def test_orbital_frame_is_that_of_spice(elements: Elements) -> None:
    """The 3-1-3 rotation by spiceypy.eul2m, and back; rounding."""
    _, _, i, raan, arg_perigee, _ = elements
    matrix = np.array(spiceypy.eul2m(arg_perigee, i, raan, 3, 1, 3))
    state = to_cartesian(elements)
    found = eci_to_orbital(*state, elements)
    for vector, expected, atol in zip(found, state, (1e-6, 1e-9), strict=True):
        np.testing.assert_allclose(vector, matrix @ expected, rtol=0, atol=atol)
    back = orbital_to_eci(*found, elements)
    for vector, expected, atol in zip(back, state, (1e-6, 1e-9), strict=True):
        np.testing.assert_allclose(vector, expected, rtol=0, atol=atol)


def test_orbital_frame_holds_the_ellipse() -> None:
    """In the orbital frame the orbit is (r cos nu, r sin nu, 0), r = a (1 - e^2) / (1 + e cos nu)."""
    position, _ = eci_to_orbital(*to_cartesian(LEADER), LEADER)
    r = 6978137.0 * (1 - 0.01) / (1 + 0.1 * math.cos(2))
    np.testing.assert_allclose(position, [r * math.cos(2), r * math.sin(2), 0], rtol=0, atol=1e-8)


def test_frames_take_any_leading_shape() -> None:
    """Followers (4, 1, 3) against a leader at (5,) times: states (4, 5, 3), each one as alone."""
    leader = to_cartesian(LEADER._replace(true_anomaly_rad=np.linspace(0, 6, 5)))
    offset, rate = np.arange(12.0).reshape(4, 1, 3), np.ones((4, 1, 3))
    position, velocity = lvlh_to_eci(offset, rate, *leader)
    assert position.shape == velocity.shape == (4, 5, 3)
    alone = lvlh_to_eci(offset[2, 0], rate[2, 0], leader[0][3], leader[1][3])
    np.testing.assert_array_equal(position[2, 3], alone[0])
    np.testing.assert_array_equal(velocity[2, 3], alone[1])
    fixed = eci_to_earth_fixed(position, velocity, np.arange(5.0))
    np.testing.assert_array_equal(fixed[0][2, 3], eci_to_earth_fixed(*alone, 3.0)[0])
