"""Transfers: closed forms and a published example, and the two-body problem integrated in an inertial frame."""

import numpy as np
import pytest
from oracles import MU, hcw_state_matrix
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from baselines.design.transfers import hohmann, spiral_delta_v, spiral_ratio, two_impulse
from formation_env.dynamics import HCW, DiscreteModel, ModifiedHCW
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
N = float(np.sqrt(MU / ORBIT.radius_m**3))
PERIOD_S = 2 * np.pi / N


def fly_kepler(start: Array, time_s: float, thrust_m_s2: float = 0.0) -> Array:
    """Two-body motion of [x, y, x', y'] in the orbit plane, ECI, with a constant thrust along the velocity."""

    def rates(_: float, state: Array) -> Array:
        place, velocity = state[:2], state[2:]
        thrust = thrust_m_s2 * velocity / np.linalg.norm(velocity)
        return np.concatenate([velocity, -MU * place / np.linalg.norm(place) ** 3 + thrust])

    return solve_ivp(rates, (0, time_s), start, "DOP853", rtol=1e-12, atol=1e-6).y[:, -1]


def circular(radius_m: float, up_m_s: float = 0.0, ahead_m_s: float = 0.0) -> Array:
    """[x, y, x', y'] on a circular orbit, after an impulse."""
    return np.array([radius_m, 0, up_m_s, np.sqrt(MU / radius_m) + ahead_m_s])


def model_over(time_s: float, dynamics: type = HCW) -> DiscreteModel:
    return dynamics().discretise(0.0, time_s, ORBIT, Spacecraft(), Spacecraft())


def test_hohmann_is_vallados_example() -> None:
    """Vallado, Fundamentals of Astrodynamics, example 6-1, to its last printed digit (its mu differs by 6e-10)."""
    transfer = hohmann(6569478.1, 42159485.6)
    assert transfer.first_m_s == pytest.approx(2457.038, abs=1e-3)
    assert transfer.second_m_s == pytest.approx(1478.187, abs=1e-3)
    assert transfer.delta_v_m_s == pytest.approx(3935.224, abs=2e-3)
    assert transfer.time_s / 3600 == pytest.approx(5.256713, abs=1e-6)


@pytest.mark.parametrize("arrival_m", [6.6e6, 7.1e6, 42.2e6])
def test_hohmann_arrives_on_the_circle(arrival_m: float) -> None:
    """Both impulses in the integrated two-body problem, up and down; the integrator is good to 1e-9 of the radius."""
    departure_m = 7e6
    transfer = hohmann(departure_m, arrival_m)
    flown = fly_kepler(circular(departure_m, 0.0, transfer.first_m_s), transfer.time_s)
    arrived = -flown + [0, 0, 0, transfer.second_m_s]  # seen from the other side of the Earth
    np.testing.assert_allclose(arrived[:2], [arrival_m, 0], atol=1e-8 * arrival_m)
    np.testing.assert_allclose(arrived[2:], circular(arrival_m)[2:], atol=1e-4)


@pytest.mark.parametrize("difference_m", [-5e3, 2e3, 2e4])
def test_weak_thrust_between_neighbours_spends_edelbaums_delta_v(difference_m: float) -> None:
    """Constant thrust along the flight over ten revolutions, integrated: the energy is the target circle's.

    What Edelbaum leaves out is of the order of the thrust over gravity, 2e-5 at most, squared. The orbit is a circle
    again as the thrust goes round a whole number of times, to the same first order of the ratio of the radii.
    """
    departure_m, arrival_m = ORBIT.radius_m, ORBIT.radius_m + difference_m
    delta_v, time_s = spiral_delta_v(departure_m, arrival_m), 10 * PERIOD_S
    end = fly_kepler(circular(departure_m), time_s, np.sign(difference_m) * delta_v / time_s)
    place, velocity = end[:2], end[2:]
    speed_2 = velocity @ velocity
    axis_m = 1 / (2 / np.linalg.norm(place) - speed_2 / MU)
    eccentricity = np.linalg.norm((speed_2 / MU - 1 / np.linalg.norm(place)) * place - place @ velocity * velocity / MU)
    assert axis_m - departure_m == pytest.approx(difference_m, rel=1e-4)
    assert eccentricity * departure_m < 0.01 * abs(difference_m)
    assert delta_v == pytest.approx(hohmann(departure_m, arrival_m).delta_v_m_s, rel=1e-5)


def test_the_141_percent_are_those_of_an_escape() -> None:
    """1 / (sqrt(2) - 1), the limit of v_A over (sqrt(2) - 1) v_A, bounds the ratio, which grows with the radii's ratio.

    So no finite transfer reaches it: to the geostationary radius the spiral costs 20 % more (circular speeds of 7789.2
    and 3074.8 m/s against the 3935.2 m/s of Vallado's example 6-1), between neighbours nothing.
    """
    ratios = np.array([spiral_ratio(7e6, 7e6 * factor) for factor in np.geomspace(1.001, 1e9, 200)])
    assert (np.diff(ratios) > 0).all()
    assert ratios[0] == pytest.approx(1.0, abs=1e-6)
    assert ratios[-1] < 1 / (np.sqrt(2) - 1)
    assert ratios[-1] == pytest.approx(2.41421356, abs=5e-4)  # what is left vanishes as the root of the radii's ratio
    assert spiral_ratio(6569478.1, 42159485.6) == pytest.approx((7789.2 - 3074.8) / 3935.2, abs=1e-4)
    assert spiral_ratio(42.164e6, 7e6) == pytest.approx(spiral_ratio(7e6, 42.164e6), rel=1e-12)


def test_wrong_radii_are_refused() -> None:
    """Each error names the argument and its value."""
    with pytest.raises(ValueError, match=r"departure_m: must be > 0 and finite, got -1"):
        hohmann(-1.0, 7e6)
    with pytest.raises(ValueError, match=r"arrival_m: must be > 0 and finite, got inf"):
        spiral_delta_v(7e6, np.inf)
    with pytest.raises(ValueError, match=r"arrival_m: must differ from departure_m = 7e\+06"):
        spiral_ratio(7e6, 7e6)


def test_hohmann_between_neighbours_is_a_quarter_of_n_x0() -> None:
    """From the leader's orbit to one x0 above in half a period: two tangential impulses of n x0 / 4 by HCW.

    With x = 4 (y0' / n) / 2 (1 - cos nt) of eq. (3.2) the first gives y0' = n x0 / 4; it ends where
    y = (4 y0' / n) sin nt - 3 y0' t is, 3 pi / 4 x0 behind, at y' = -7 / 4 n x0, a quarter short of -3 / 2 n x0. The
    inertial Hohmann transfer agrees to first order in x0 / r: the next one is 2 x0 / r.
    """
    x0 = 1000.0
    goal = np.array([x0, -0.75 * np.pi * x0, 0, 0, -1.5 * N * x0, 0])
    transfer = two_impulse(model_over(PERIOD_S / 2), PERIOD_S / 2, N, np.zeros(6), goal)
    np.testing.assert_allclose(transfer.first_m_s, [0, N * x0 / 4, 0], atol=1e-9)
    np.testing.assert_allclose(transfer.second_m_s, [0, N * x0 / 4, 0], atol=1e-9)
    exact = hohmann(ORBIT.radius_m, ORBIT.radius_m + x0)
    assert transfer.delta_v_m_s == pytest.approx(exact.delta_v_m_s, rel=2 * x0 / ORBIT.radius_m)
    assert transfer.delta_v_m_s == pytest.approx(N * x0 / 2, rel=1e-9)


@pytest.mark.parametrize("dynamics", [HCW, ModifiedHCW])
@pytest.mark.parametrize("periods", [0.05, 0.3, 0.75, 1.3, 3.6])
def test_two_impulses_lead_from_any_state_to_any_other(periods: float, dynamics: type) -> None:
    """Against the equations of motion by the matrix exponential of a state matrix; J2 within its own model."""
    rng, time_s = np.random.default_rng(11), periods * PERIOD_S
    A = hcw_state_matrix(N) if dynamics is HCW else dynamics().state_matrix(ORBIT, Spacecraft())
    for _ in range(20):
        start, goal = rng.normal(size=(2, 6)) * np.repeat([2000.0, 2.0], 3)
        transfer = two_impulse(model_over(time_s, dynamics), time_s, N, start, goal)
        leaves = start + np.concatenate([np.zeros(3), transfer.first_m_s])
        arrives = expm(A * time_s) @ leaves + np.concatenate([np.zeros(3), transfer.second_m_s])
        # rounding of both matrix exponentials, 1e-11 of the km that the follower drifts
        np.testing.assert_allclose(arrives, goal, rtol=0, atol=1e-6)


def test_two_impulses_miss_in_the_nonlinear_world_by_the_square_of_the_distance() -> None:
    """Flown in the two-body problem: the linear model misses by a few d^2 / r, so by a quarter at half the distance."""
    time_s, misses = 0.4 * PERIOD_S, []
    leader = fly_kepler(circular(ORBIT.radius_m), time_s)
    turn = np.array([leader[:2], [-leader[1], leader[0]]]) / ORBIT.radius_m
    for distance_m in (4000.0, 2000.0):
        goal = np.array([0, distance_m, 0, 0, 0, 0])
        first = two_impulse(model_over(time_s), time_s, N, np.zeros(6), goal).first_m_s
        end = fly_kepler(circular(ORBIT.radius_m, first[0], first[1]), time_s)
        misses.append(np.linalg.norm(turn @ (end - leader)[:2] - goal[:2]))
    assert misses[0] < 3 * 4000.0**2 / ORBIT.radius_m
    assert misses[0] / misses[1] == pytest.approx(4, rel=0.01)


@pytest.mark.parametrize(
    ("periods", "axis", "direction"), [(0.5, 2, "[0.0, 0.0, 1.0]"), (1.0, 0, "1.0, 0.0, 0.0]"), (1.0, 2, "1.0]")]
)
@pytest.mark.parametrize("off_periods", [0.0, 0.003])
def test_singular_times_are_refused(periods: float, axis: int, direction: str, off_periods: float) -> None:
    """At half periods z, at whole periods x come back whatever the impulse (eq. 3.2-3.4); close by, almost."""
    time_s, goal = (periods + off_periods) * PERIOD_S, np.zeros(6)
    goal[axis] = 500.0
    with pytest.raises(ValueError, match=r"time_s: no two impulses .* periods\) reach the goal: 500 m off") as error:
        two_impulse(model_over(time_s), time_s, N, np.zeros(6), goal)
    assert direction.replace("-", "") in str(error.value).replace("-", "")
    assert "\n" not in str(error.value)


def test_what_needs_no_leverage_is_flown_at_singular_times() -> None:
    """After a whole period along-track changes by -3 y0' p alone (eq. 3.3): x and z have nowhere to go."""
    goal = np.array([0, -900.0, 0, 0, 0, 0])
    transfer = two_impulse(model_over(PERIOD_S), PERIOD_S, N, np.zeros(6), goal)
    np.testing.assert_allclose(transfer.first_m_s, [0, 300 / PERIOD_S, 0], atol=1e-6)
