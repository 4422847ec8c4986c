"""The models of the relative motion, against the equations, published numbers and a nonlinear truth."""

import math
from collections.abc import Callable

import numpy as np
import oracles
import pytest
import truth
from oracles import Array, hcw_state_matrix, without_units
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from formation_env.dynamics import DYNAMICS, HCW, ModifiedHCW, PrintedHCW, get_dynamics
from formation_env.dynamics.hcw import transition_matrix
from formation_env.dynamics.propagation import propagate
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.orbital.orbit import Orbit

ORBIT = truth.ORBIT
N = math.sqrt(oracles.MU / 6978137.0**3)
NO_AIR = Spacecraft(air_density_kg_m3=0.0)
# Air so dense that drag changes every digit that the tests look at.
DENSE = Spacecraft(air_density_kg_m3=1e-8)
DENSE_LEADER = Spacecraft(air_density_kg_m3=1e-8, area_m2=0.32)
MEAN_RADIUS_M = 6972235.0


@pytest.mark.parametrize("time_s", [-4000.0, 0.0, 0.1, 30.0, 2900.0, 58000.0])
def test_closed_form_is_the_matrix_exponential(time_s: float) -> None:
    """Phi(t) = exp(A t); expm loses about 1e-16 |A t|^2, below 1e-11 here."""
    expected = expm(hcw_state_matrix(N) * time_s)
    actual = transition_matrix(N, time_s)
    np.testing.assert_allclose(without_units(actual, N), without_units(expected, N), rtol=0, atol=1e-10)


def test_closed_form_is_a_semigroup() -> None:
    """An LTI propagator over 700 s and then 1300 s is the one over 2000 s; only rounding may differ."""
    steps = without_units(transition_matrix(N, [700.0, 1300.0, 2000.0]), N)
    np.testing.assert_allclose(steps[1] @ steps[0], steps[2], rtol=0, atol=1e-13)


def test_vallado_example_6_14() -> None:
    """Published to 1e-15 m (CelesTrak fundamentals-of-astrodynamics, test_hills.py), computed in km: rounding only."""
    n = math.sqrt(398600.4415e9 / (6378.1363e3 + 590e3) ** 3)
    state = transition_matrix(n, 300.0) @ [0, 0, 0, -0.1, -0.04, -0.02]
    position = [-33.345724432187964, -1.473560307487475, -5.894530311607677]
    velocity = [-0.120337093866688, 0.032387584447866, -0.018949031717993]
    np.testing.assert_allclose(state, position + velocity, rtol=1e-11)


def worst_error_m(case: str, force: str, dynamics: str, orbit: Orbit) -> float:
    """Largest position error of a model against the truth over the first orbit, m."""
    times, states = truth.load(case, force)
    first = times < 1.001 * truth.PERIOD_S
    modelled = propagate(states[0], times[first], dynamics=dynamics, orbit=orbit, spacecraft=NO_AIR)
    return float(np.linalg.norm((modelled - states[first])[:, :3], axis=1).max())


@pytest.mark.parametrize(
    ("case", "published_m"),
    [("space_circle", 11.2), ("projected_circle", 10.4), ("xy_ellipse", 5.4), ("following", 10.8)],
)
def test_hcw_errs_by_its_linearisation(case: str, published_m: float) -> None:
    """Two-body truth: HCW drops terms of order 3 d^2 / r; 3 % cover the table's rounding and the coarser rows."""
    assert worst_error_m(case, "twobody", "hcw", ORBIT) == pytest.approx(published_m, rel=0.03)


@pytest.mark.parametrize(
    ("case", "osculating_m", "mean_m"),
    [
        ("space_circle", 105.0, 22.4),
        ("projected_circle", 38.8, 39.0),
        ("xy_ellipse", 83.9, 43.6),
        ("following", 15.8, 15.8),
    ],
)
def test_modified_hcw_errs_under_j2_as_measured(case: str, osculating_m: float, mean_m: float) -> None:
    """J2 truth: the errors published with it, at the leader's osculating and mean radius; 3 % as above."""
    assert worst_error_m(case, "j2", "modified_hcw", ORBIT) == pytest.approx(osculating_m, rel=0.03)
    at_mean = Orbit(altitude_m=MEAN_RADIUS_M - oracles.R_EARTH)
    assert worst_error_m(case, "j2", "modified_hcw", at_mean) == pytest.approx(mean_m, rel=0.03)


def test_modified_hcw_without_j2_and_air_is_hcw() -> None:
    """With both perturbations off, s = 0 and c = 1: the same matrix, bit for bit."""
    orbit = Orbit(j2=False)
    np.testing.assert_array_equal(
        ModifiedHCW().state_matrix(orbit, NO_AIR), HCW().state_matrix(orbit, NO_AIR), strict=True
    )


def cross_track_frequency(orbit: Orbit) -> float:
    """K of the model, rad/s."""
    return math.sqrt(-ModifiedHCW().state_matrix(orbit, NO_AIR)[5, 2])


@pytest.mark.parametrize(
    ("inclination_deg", "s_per_q", "node_per_q"),
    [(0.0, 1.5, 1.5), (90.0, -0.75, 0.0), (math.degrees(math.acos(3**-0.5)), 0.0, 0.5)],
)
def test_schweighart_sedwick_constants(inclination_deg: float, s_per_q: float, node_per_q: float) -> None:
    """By hand, q = J2 (R/r)^2: s = q (3/8) (1 + 3 cos 2i), k = n sqrt(1 + s) + n q (3/2) cos^2 i; s = 0 at 54.7 deg."""
    A = ModifiedHCW().state_matrix(Orbit(altitude_m=600000.4, inclination_deg=inclination_deg), NO_AIR)
    q = oracles.J2 * (oracles.R_EARTH / 6978137.0) ** 2
    c = math.sqrt(1 + s_per_q * q)
    assert A[3, 4] == -A[4, 3] == pytest.approx(2 * N * c, rel=1e-12)
    assert A[3, 0] == pytest.approx((5 * c**2 - 2) * N**2, rel=1e-12)
    assert math.sqrt(-A[5, 2]) == pytest.approx(N * (c + node_per_q * q), rel=1e-12)


def test_frequencies_at_the_mean_radius_are_those_of_the_true_leader() -> None:
    """Integrated leader: k is its nodal frequency, n c its mean rate.

    The model drops terms of order J2^2 = 1e-6 and the mean radius is known to as much; measured 3.3e-6 and 0.7e-6.
    """
    times, states = oracles.fly_under_j2(10, math.radians(60), 6978137.0)
    radius = np.linalg.norm(states[:3], axis=0)
    momentum = np.linalg.norm(np.cross(states[:3].T, states[3:].T), axis=1)
    orbit = Orbit(altitude_m=radius[:-1].mean() - oracles.R_EARTH)
    assert orbit.radius_m == pytest.approx(MEAN_RADIUS_M, abs=20)
    nodal = 2 * np.pi * 10 / (times[-1] - times[0])
    assert cross_track_frequency(orbit) == pytest.approx(nodal, rel=6e-6)
    mean_rate = (momentum / radius**2)[:-1].mean()
    assert ModifiedHCW().state_matrix(orbit, NO_AIR)[3, 4] / 2 == pytest.approx(mean_rate, rel=6e-6)


def crossing_s(times: Array, states: Array) -> float:
    """When z goes through 0 between two of the truth's rows (cubic in 60 s: exact to 1e-4 s)."""
    return float(CubicHermiteSpline(times, states[:, 2], states[:, 5]).roots(extrapolate=False)[0])


def test_cross_track_frequency_is_that_of_the_truth() -> None:
    """Space circle under J2: nine revolutions of z between two zeros.

    7.4e-6 is left, as a twentieth of its z comes from a difference in inclination, which J2 turns at another rate. With
    c n for k it would be 2.5e-4.
    """
    times, states = truth.load("space_circle", "j2")
    first, last = ((begin <= times) & (times <= begin + 60) for begin in (1500, 53640))
    span = crossing_s(times[last], states[last]) - crossing_s(times[first], states[first])
    at_mean = Orbit(altitude_m=MEAN_RADIUS_M - oracles.R_EARTH)
    assert cross_track_frequency(at_mean) == pytest.approx(18 * np.pi / span, rel=1e-5)


@pytest.mark.parametrize("case", truth.CASES)
def test_unequal_drag_moves_the_follower_as_in_the_truth(case: str) -> None:
    """The leader has twice the follower's drag: it sinks, runs ahead, and the follower is left behind and above.

    Truth with unequal minus truth with equal coefficients, so that J2 and curvature cancel to their product with the
    shift: 1e-3 of it along the track and 3e-3 radially in one orbit.
    """
    times, unequal = truth.load(case, "j2drag_diff")
    shift = (unequal - truth.load(case, "j2drag_same")[1])[:, :2]
    leader = Spacecraft(area_m2=0.32)
    modelled = propagate(unequal[0], times, orbit=ORBIT, leader_spacecraft=leader) - propagate(
        unequal[0], times, orbit=ORBIT
    )
    assert shift[1, 1] < -0.4
    assert shift[1, 0] > 0.1
    np.testing.assert_allclose(modelled[:, 1], shift[:, 1], rtol=1e-3)
    np.testing.assert_allclose(modelled[1, 0], shift[1, 0], rtol=3e-3)


def test_equal_drag_draws_followers_together_as_in_the_truth() -> None:
    """Truth with drag minus truth without: 29 um per orbit nearer; the file's last digit is 0.1 um, twice."""
    times, dragged = truth.load("following", "j2drag_same")
    free_times, free = truth.load("following", "j2")
    shift = dragged[1, 1] - free[np.flatnonzero(free_times == times[1])[0], 1]
    modelled = propagate(dragged[0], times[1:2], orbit=ORBIT) - propagate(
        dragged[0], times[1:2], orbit=ORBIT, spacecraft=NO_AIR
    )
    assert modelled[0, 1] == pytest.approx(shift, abs=3e-7)
    assert modelled[0, 1] < -2e-5


def test_equal_drag_damps_every_oscillation() -> None:
    """First order in D = rho v / B, by hand: in-plane modes decay at 3/4 D, cross-track ones at 1/4 D."""
    drag = 1e-8 / 312.5 * N * 6978137.0
    orbit = Orbit(altitude_m=600000.4, j2=False)
    eigenvalues = np.linalg.eigvals(ModifiedHCW().state_matrix(orbit, DENSE))
    fast = eigenvalues[eigenvalues.imag > 0.5 * N]
    # D / n = 2e-4 is the size of what the first order leaves out.
    np.testing.assert_allclose(np.sort(fast.real), [-0.75 * drag, -0.25 * drag], rtol=1e-3)


def test_printed_cross_track_frequency_is_the_misprint_to_the_letter() -> None:
    """k = n sqrt(1 + s) + 3 J2 R_E^2 / (2 r1^2) cos^2 i (eq. 2.62): 1.4222e-3 rad/s.

    By hand for 600 km, 60 deg: n = 1.08308e-3, sqrt(1 + s) = 0.999915, 3/2 * 1.08263e-3 * 0.914017^2 / 4 = 3.3917e-4;
    four digits are kept.
    """
    orbit = Orbit()
    printed, meant = (kind().state_matrix(orbit, NO_AIR) for kind in (PrintedHCW, ModifiedHCW))
    assert math.sqrt(-printed[5, 2]) == pytest.approx(1.08308e-3 * 0.999915 + 3.3917e-4, rel=1e-4)
    printed[5, 2] = meant[5, 2]
    np.testing.assert_array_equal(printed, meant)


def modified_hcw_rates(state: Array, thrust: Array) -> Array:
    """The thesis's equations (2.66-2.70) in dense air, written out for the leader of the truth files."""
    x, y, z, vx, vy, vz = state
    r, cos_i = 6978137.0, math.cos(math.radians(60))
    speed, drag = N * r, 1e-8 * (0.16 / 50) * N * r
    s = 3 * oracles.J2 * oracles.R_EARTH**2 / (8 * r**2) * (1 + 3 * math.cos(math.radians(120)))
    c = math.sqrt(1 + s)
    k = N * c + 3 * N * oracles.J2 * oracles.R_EARTH**2 / (2 * r**2) * cos_i**2
    lag = -1e-8 * speed**2 / 2 * (0.16 / 50 - 0.32 / 50)
    ax = 2 * N * c * vy + (5 * c**2 - 2) * N**2 * x + thrust[0] - drag / 2 * (vx - N * y)
    ay = -2 * N * c * vx + thrust[1] - drag * (vy + N * x) + lag
    az = -(k**2) * z + thrust[2] - drag / 2 * vz
    return np.array([vx, vy, vz, ax, ay, az])


def hcw_rates(state: Array, thrust: Array) -> Array:
    """Equations (2.54-2.56)."""
    return hcw_state_matrix(N) @ state + np.concatenate([np.zeros(3), thrust])


@pytest.mark.parametrize("step_s", [1.0, 30.0, 2900.0])
@pytest.mark.parametrize(("name", "rates"), [("hcw", hcw_rates), ("modified_hcw", modified_hcw_rates)])
@pytest.mark.parametrize(
    ("state", "thrust"),
    [
        ([2000.0, 369.3, 3464.1, 0.2, -4.33, 0.346], [0.0, 0.0, 0.0]),
        ([0.0] * 6, [0.01, -0.02, 0.03]),
        ([0.0] * 6, [0.0, 0.0, 0.0]),
    ],
    ids=["Phi", "Gamma", "delta"],
)
def test_discretisation_solves_the_equations(
    name: str, rates: Callable[[Array, Array], Array], step_s: float, state: list[float], thrust: list[float]
) -> None:
    """Phi x + Gamma u + delta is the solution of the ODE with u held (DOP853 to 1e-12 of the largest value)."""
    model = get_dynamics(name).discretise(0.0, step_s, ORBIT, DENSE, DENSE_LEADER)
    actual = model.Phi @ state + model.Gamma @ thrust + model.delta
    solution = solve_ivp(lambda _, s: rates(s, thrust), (0, step_s), state, "DOP853", rtol=1e-12, atol=1e-12)
    scale = max(1.0, np.abs(solution.y).max())
    np.testing.assert_allclose(actual, solution.y[:, -1], rtol=0, atol=1e-10 * scale)


def test_many_steps_at_once_equal_one_by_one() -> None:
    """An array of steps gives, along its axes, what each step gives alone."""
    steps = np.array([[0.0, 1.0], [30.0, -500.0]])
    together = ModifiedHCW().discretise(0.0, steps, ORBIT, DENSE, DENSE_LEADER)
    assert together.Phi.shape == (2, 2, 6, 6)
    for index in np.ndindex(steps.shape):
        alone = ModifiedHCW().discretise(0.0, steps[index], ORBIT, DENSE, DENSE_LEADER)
        np.testing.assert_array_equal(together.Phi[index], alone.Phi)
        np.testing.assert_array_equal(together.Gamma[index], alone.Gamma)
        np.testing.assert_array_equal(together.delta[index], alone.delta)


@pytest.mark.parametrize("name", DYNAMICS)
def test_orbit_plane_and_cross_track_do_not_mix(name: str) -> None:
    """The contract that lets the filter treat them apart: no element of A, Gamma or d couples them."""
    model = get_dynamics(name).discretise(0.0, 30.0, ORBIT, DENSE, DENSE_LEADER)
    plane, normal = np.array([0, 1, 3, 4]), np.array([2, 5])
    assert not model.Phi[np.ix_(plane, normal)].any()
    assert not model.Phi[np.ix_(normal, plane)].any()
    assert not model.Gamma[plane, 2].any()
    assert not model.Gamma[normal, :2].any()
    assert not model.delta[normal].any()


def test_unknown_dynamics_names_its_neighbour() -> None:
    """A misspelt model is refused with a hint."""
    with pytest.raises(ValueError, match=r"^dynamics: no model named 'modified_hwc'; did you mean 'modified_hcw'\?$"):
        get_dynamics("modified_hwc")
