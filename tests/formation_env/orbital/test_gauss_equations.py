"""Gauss's variational equations against derivatives by SPICE and against Cartesian flights."""

import math

import numpy as np
import oracles
import pytest
import spiceypy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from formation_env.orbital.elements import Elements, to_cartesian
from formation_env.orbital.gauss_equations import element_rates, propagate_elements
from formation_env.orbital.kepler import true_to_mean

Array = NDArray[np.float64]

ANGLE = st.floats(0, 6.28)
REGULAR = st.builds(Elements, st.floats(6.6e6, 5e7), st.floats(0.02, 0.8), st.floats(0.05, 3.0), ANGLE, ANGLE, ANGLE)
THRUST = st.tuples(*[st.floats(-1e-3, 1e-3)] * 3)

# orbits on which one set of elements or another is singular
ORBITS = {
    "circular": Elements(6978137.0, 0.0, math.radians(60), 0.0, 0.0, 0.0),
    "equatorial": Elements(7.2e6, 0.02, 0.0, 0.0, 1.0, 2.0),
    "circular and equatorial": Elements(7.0e6, 0.0, 0.0, 0.0, 0.0, 0.5),
    "backwards over the equator": Elements(7.0e6, 0.0, math.pi, 0.0, 0.0, 0.5),
    "eccentric": Elements(2.66e7, 0.74, 1.1, 0.5, 4.7, 1.0),
}


def pull(_: float, position: Array, velocity: Array) -> Array:
    """J2, a drag a thousand times that of the thesis, and a small push along (1, 2, 3), of its own making."""
    r = np.linalg.norm(position, axis=-1, keepdims=True)
    q = 1.5 * oracles.J2 * oracles.MU * oracles.R_EARTH**2 / r**5
    j2 = -q * position * (np.array([1, 1, 3]) - 5 * (position[..., 2:] / r) ** 2)
    drag = -1.6e-13 * np.linalg.norm(velocity, axis=-1, keepdims=True) * velocity
    return j2 + drag + 1e-6 * np.array([1, 2, 3])


def cartesian_flight(elements: Elements, times: Array) -> Array:
    """States (6, T) under gravity and `pull`, integrated in Cartesian coordinates."""

    def rates(time: float, state: Array) -> Array:
        position, velocity = state[:3], state[3:]
        central = -oracles.MU / np.linalg.norm(position) ** 3 * position
        return np.concatenate([velocity, central + pull(time, position, velocity)])

    start = np.concatenate(to_cartesian(elements))
    return solve_ivp(rates, (times[0], times[-1]), start, "DOP853", t_eval=times, rtol=1e-12, atol=1e-7).y


def spice_elements(state: Array) -> Array:
    """a, e, i, RAAN, argument of perigee and mean anomaly by spiceypy.oscelt."""
    rp, e, *angles = spiceypy.oscelt(state, 0, oracles.MU)[:6]
    return np.array([rp / (1 - e), e, *angles])


@given(REGULAR, THRUST)
def test_rates_are_the_derivatives_of_the_elements(elements: Elements, thrust: tuple[float, float, float]) -> None:
    """A kick f dt changes the elements by rate dt: central differences over a kick of at most 0.2 m/s.

    Their error is (kick / (e v))^2, here 1e-5 of the rates' scale f / (n a), over e, 1 - e and sin i.
    """
    position, velocity = to_cartesian(elements)
    radial, normal = position / np.linalg.norm(position), np.cross(position, velocity)
    normal = normal / np.linalg.norm(normal)
    direction = np.array(thrust) @ np.stack([radial, np.cross(normal, radial), normal])
    kick_s = 0.1 / 1e-3
    ahead = spice_elements(np.concatenate([position, velocity + direction * kick_s]))
    behind = spice_elements(np.concatenate([position, velocity - direction * kick_s]))
    change = ahead - behind
    change[2:] -= 2 * math.pi * np.round(change[2:] / (2 * math.pi))
    a, e, i = (float(value) for value in elements[:3])
    n = math.sqrt(oracles.MU / a**3)
    found = np.array(element_rates(elements, thrust)) - [0, 0, 0, 0, 0, n]
    scale = 1e-3 / (n * a * (1 - e) * e * math.sin(i)) * np.array([a, 1, 1, 1, 1, 1])
    np.testing.assert_allclose((found - change / (2 * kick_s)) / scale, 0, atol=1e-5)


def test_rates_of_classical_elements_need_them_defined() -> None:
    """On a circle or the equator the angles have no rates."""
    for e, i in ((0.0, 1.0), (0.1, 0.0), (0.1, math.pi), (1e-16, 1.0), (0.1, 1e-14)):  # the last three by rounding
        elements = Elements(7e6, e, i, 0, 0, 0)
        with pytest.raises(ValueError, match="circular or equatorial"):
            element_rates(elements, [1e-3, 0, 0])


@pytest.mark.parametrize("name", ORBITS)
def test_propagation_is_the_cartesian_flight(name: str) -> None:
    """Two revolutions under strong forces: the two integrators, both at 1e-11 or better, agree to centimetres."""
    elements = ORBITS[name]
    times = np.linspace(0, 4 * math.pi * math.sqrt(float(elements.semi_major_axis_m) ** 3 / oracles.MU), 9)
    position, velocity = to_cartesian(propagate_elements(elements, times, pull))
    expected = cartesian_flight(elements, times)
    np.testing.assert_allclose(position, expected[:3].T, rtol=0, atol=0.02)
    np.testing.assert_allclose(velocity, expected[3:].T, rtol=0, atol=5e-5)


def test_without_a_force_only_the_anomaly_moves() -> None:
    """Two bodies: M = M0 + n t, all else stays; to the integrator's 1e-11 over three revolutions of a batch (2, 1)."""
    elements = Elements(np.array([[7e6], [9e6]]), 0.1, 0.5, 1.0, 2.0, 3.0)
    times = np.linspace(0, 18e3, 5)
    path = propagate_elements(elements, times, lambda time, position, velocity: np.zeros_like(position))
    assert all(np.shape(field) == (2, 1, 5) for field in path)
    for found, start in zip(path[:5], elements[:5], strict=True):
        np.testing.assert_allclose(found, np.broadcast_to(np.expand_dims(start, -1), (2, 1, 5)), rtol=1e-9)
    n = np.sqrt(oracles.MU / np.array([[[7e6]], [[9e6]]]) ** 3)
    turns = (true_to_mean(path.true_anomaly_rad, 0.1) - true_to_mean(3.0, 0.1) - n * times) / (2 * math.pi)
    np.testing.assert_allclose(turns, np.round(turns), rtol=0, atol=1e-8)


def test_leaving_the_ellipses_is_refused() -> None:
    """A push of 1 m/s^2 along the motion for two hours exceeds the escape speed."""

    def push(time: float, position: Array, velocity: Array) -> Array:
        return velocity / np.linalg.norm(velocity)

    with pytest.raises(ValueError, match="must be on an elliptic orbit"):
        propagate_elements(ORBITS["circular"], [0.0, 7200.0], push)


@pytest.mark.parametrize("times", [[], [0.0], [-3.0]])
def test_no_time_and_one_time(times: list[float]) -> None:
    """The elements at the first time are those given."""
    path = propagate_elements(ORBITS["eccentric"], times, pull)
    assert all(np.shape(field) == (len(times),) for field in path)
    for found, start in zip(path, ORBITS["eccentric"], strict=True):
        np.testing.assert_allclose(found, np.full(len(times), start), rtol=1e-12)


@pytest.mark.parametrize("times", [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan], 3.0, [[0.0]]])
def test_times_must_increase(times: object) -> None:
    with pytest.raises(ValueError, match="times_s: must be finite and increasing"):
        propagate_elements(ORBITS["circular"], times, pull)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("force", "reason"),
    [(np.nan, "rates that are not finite at t = 0 s"), (1e200, "step size .* at t = ")],
)
def test_a_force_that_cannot_be_integrated_is_an_error(force: float, reason: str) -> None:
    """The integrator never returned."""
    with pytest.raises(ValueError, match=f"perturbation: the motion cannot be integrated: .*{reason}"):
        propagate_elements(ORBITS["circular"], [0.0, 7200.0], lambda time, position, velocity: force * velocity)
