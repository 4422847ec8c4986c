"""Leaders on elliptic orbits: the transition matrix, the formations, and the filter and policies that use them."""

import dataclasses

import numpy as np
import oracles
import pytest
from env_helpers import noise_free
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from oracles import without_units
from scipy.integrate import solve_ivp

from baselines import make_policy
from formation_env import ConfigError, FormationVectorEnv, load_scenario
from formation_env.dynamics import get_dynamics
from formation_env.dynamics.hcw import transition_matrix as hcw_transition_matrix
from formation_env.dynamics.propagation import propagate
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.yamanaka_ankersen import transition_matrix
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.formations import Following, Formation, InTrack, Parallel, ProjectedCircle, SpaceCircle, XYEllipse
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.orbital.orbit import Orbit
from formation_env.settings import build

Array = NDArray[np.float64]
NO_AIR = Spacecraft(air_density_kg_m3=0.0)


def elliptic(eccentricity: float, true_anomaly_deg: float = 0.0) -> Orbit:
    """An ellipse whose perigee is at 600 km, without J2."""
    perigee_m = oracles.R_EARTH + 600e3
    altitude_m = perigee_m / (1 - eccentricity) - oracles.R_EARTH
    return Orbit(altitude_m=altitude_m, eccentricity=eccentricity, true_anomaly_deg=true_anomaly_deg, j2=False)


def linearised(orbit: Orbit, start_s: float, end_s: float) -> Array:
    """Transition matrix by integrating the leader in polar coordinates and the linear equations about it."""

    def rates(_: float, y: Array) -> Array:
        r, speed, _, h = y[:4]
        rate, pull = h / r**2, oracles.MU / r**3
        turn = -2 * speed * rate / r
        A = np.zeros((6, 6))
        A[:3, 3:] = np.eye(3)
        A[3:, :3] = [[rate**2 + 2 * pull, turn, 0], [-turn, rate**2 - pull, 0], [0, 0, -pull]]
        A[3:, 3:] = [[0, 2 * rate, 0], [-2 * rate, 0, 0], [0, 0, 0]]
        return np.concatenate([[speed, r * rate**2 - oracles.MU / r**2, rate, 0], (A @ y[4:].reshape(6, 6)).ravel()])

    a, e, theta = oracles.R_EARTH + orbit.altitude_m, orbit.eccentricity, np.radians(orbit.true_anomaly_deg)
    h = np.sqrt(oracles.MU * a * (1 - e**2))
    begin = [a * (1 - e**2) / (1 + e * np.cos(theta)), oracles.MU / h * e * np.sin(theta), theta, h]
    if start_s != 0:
        begin = solve_ivp(
            lambda t, y: rates(t, np.append(y, np.zeros(36)))[:4], (0, start_s), begin, "DOP853", rtol=1e-12, atol=1e-9
        ).y[:, -1]
    whole = np.concatenate([begin, np.eye(6).ravel()])
    flown = solve_ivp(rates, (start_s, end_s), whole, "DOP853", rtol=1e-12, atol=1e-9).y[4:, -1]
    return np.asarray(flown.reshape(6, 6))


@pytest.mark.parametrize("eccentricity", [0.0, 0.05, 0.3, 0.7])
@pytest.mark.parametrize(("start_s", "end_s"), [(0.0, 30.0), (1000.0, 4000.0), (5000.0, 20000.0)])
def test_transition_matrix_is_the_integrated_one(eccentricity: float, start_s: float, end_s: float) -> None:
    """Closed form against the integrated variational equations; both to 1e-9 of the largest element, without units."""
    orbit = elliptic(eccentricity, 40.0)
    expected = without_units(linearised(orbit, start_s, end_s), orbit.mean_motion_rad_s)
    actual = without_units(transition_matrix(orbit, start_s, end_s), orbit.mean_motion_rad_s)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@given(st.floats(-20000, 20000), st.floats(-20000, 20000))
def test_circle_is_hcw(start_s: float, end_s: float) -> None:
    """At e = 0 it is the closed form of HCW to 1e-9 (elements without units reach 130)."""
    orbit = Orbit(j2=False)
    n = orbit.mean_motion_rad_s
    actual = without_units(transition_matrix(orbit, start_s, end_s), n)
    np.testing.assert_allclose(actual, without_units(hcw_transition_matrix(n, end_s - start_s), n), rtol=0, atol=1e-9)


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.5])
def test_input_matrix_is_the_integrated_one(eccentricity: float) -> None:
    """x' = A x + B u with a constant thrust, integrated by scipy over a step of 300 s, against Gamma."""
    orbit, dynamics = elliptic(eccentricity, 100.0), get_dynamics("yamanaka_ankersen")
    model = dynamics.discretise(2000.0, 300.0, orbit, NO_AIR, NO_AIR)

    def rates(time_s: float, y: Array) -> Array:
        columns = dynamics.state_matrix(orbit, NO_AIR, time_s) @ y.reshape(6, 3)
        columns[3:] += np.eye(3)
        return np.asarray(columns).ravel()

    flown = solve_ivp(rates, (2000, 2300), np.zeros(18), "DOP853", rtol=1e-12, atol=1e-9).y[:, -1].reshape(6, 3)
    np.testing.assert_allclose(model.Gamma, flown, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("share", [0.1, 0.5])
@pytest.mark.parametrize("from_perigee", [-0.5, 0.0, 0.7])
def test_input_matrix_of_long_steps_on_a_long_ellipse(from_perigee: float, share: float) -> None:
    """At e = 0.81, steps of a tenth and half of the period, across the perigee and off it: to 1e-9.

    The linear equations under a constant thrust, by scipy to 1e-12; six nodes evenly spaced in time were 1.5 % off.
    """
    orbit = elliptic(0.81)
    step_s = share * orbit.period_s
    start_s = from_perigee * step_s
    dynamics = get_dynamics("yamanaka_ankersen")
    model = dynamics.discretise(start_s, step_s, orbit, NO_AIR, NO_AIR)

    def rates(time_s: float, y: Array) -> Array:
        columns = dynamics.state_matrix(orbit, NO_AIR, time_s) @ y.reshape(6, 3)
        columns[3:] += np.eye(3)
        return np.asarray(columns).ravel()

    end_s = start_s + step_s
    flown = solve_ivp(rates, (start_s, end_s), np.zeros(18), "DOP853", rtol=1e-12, atol=1e-9).y[:, -1].reshape(6, 3)
    for rows in (slice(0, 3), slice(3, 6)):
        np.testing.assert_allclose(model.Gamma[rows], flown[rows], rtol=0, atol=1e-9 * np.abs(flown[rows]).max())


@pytest.mark.parametrize("eccentricity", [0.02, 0.1, 0.5])
@pytest.mark.parametrize(
    "formation", [SpaceCircle(), ProjectedCircle(), XYEllipse(), Following(), SpaceCircle(vx0_m_s=1.0)]
)
def test_formations_close_on_an_ellipse(formation: Formation, eccentricity: float) -> None:
    """After a period the linear path is back where it began, wherever the leader is then: to 1e-6 m of kilometres."""
    orbit = elliptic(eccentricity, 75.0)
    begin = 0.3 * orbit.period_s
    path = formation.reference([begin, begin + orbit.period_s], orbit, begin)
    np.testing.assert_allclose(path[0], formation.state(orbit, begin), rtol=0, atol=1e-6)
    np.testing.assert_allclose(path[1], path[0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("formation", [SpaceCircle(), Following()])
def test_formations_are_free_motion(formation: Formation) -> None:
    """Nonlinear two-body truth over an orbit at e = 0.1: the rest is second order, so it falls fourfold at half size.

    4 km at 7000 km drift by 3 pi times 4^2 / 7000 km = 20 m or so.
    """
    orbit = elliptic(0.1)
    times = np.linspace(0, orbit.period_s, 50)
    missed = []
    for share in (1.0, 0.5):
        start = share * formation.state(orbit)
        flown = propagate(start, times, dynamics="nonlinear", orbit=orbit, spacecraft=NO_AIR)
        missed.append(np.linalg.norm((flown - share * formation.reference(times, orbit))[:, :3], axis=1).max())
    assert missed[0] < 60
    assert missed[0] / missed[1] == pytest.approx(4, rel=0.05)


def test_following_is_the_leaders_own_path() -> None:
    """A follower some seconds ahead on the leader's ellipse: the leader's velocity times these seconds."""
    orbit = elliptic(0.3)
    times = np.linspace(0, orbit.period_s, 30)
    path = Following(y0_m=10.0).reference(times, orbit)
    perigee = orbit.semi_major_axis_m * 0.7
    speed = np.sqrt(oracles.MU * (2 / perigee - 1 / orbit.semi_major_axis_m))
    theta = orbit.true_anomaly_rad(times)
    radial = np.sqrt(oracles.MU / (perigee * 1.3)) * 0.3 * np.sin(theta)
    transverse = np.sqrt(oracles.MU / (perigee * 1.3)) * (1 + 0.3 * np.cos(theta))
    np.testing.assert_allclose(path[:, 0], 10 / speed * radial, rtol=0, atol=1e-6)
    np.testing.assert_allclose(path[:, 1], 10 / speed * transverse, rtol=0, atol=1e-6)


@pytest.mark.parametrize("formation", [Parallel(), InTrack()])
def test_formations_of_circles_refuse_ellipses(formation: Formation) -> None:
    """What has no counterpart on an ellipse says so."""
    with pytest.raises(ValueError, match=f"formation {formation.kind}: needs a circular orbit, got eccentricity 0.1"):
        formation.state(elliptic(0.1))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"eccentricity": 1.0}, "eccentricity: must be less than 1"),
        ({"eccentricity": 0.2}, "eccentricity: the perigee must be above 100000 m, got -795627 m"),
        (
            {"altitude_m": 2e6, "eccentricity": 0.1, "mean_motion_from": "mean"},
            "mean_motion_from: mean needs eccentricity 0, got 0.1",
        ),
    ],
)
def test_impossible_orbits_are_refused(settings: dict[str, object], message: str) -> None:
    """The message names key and value."""
    with pytest.raises(ConfigError, match=message):
        build(Orbit, settings, "orbit")


def test_linear_truth_and_filter_about_an_ellipse_agree() -> None:
    """Truth and filter by the same model for each step: without noise the estimate stays on the truth."""
    phases = load_scenario("initialization").phases
    scenario = dataclasses.replace(noise_free("keeping_eccentric"), dynamics="yamanaka_ankersen", phases=phases)
    env = FormationVectorEnv(3, scenario)
    state = np.array([300.0, -200.0, 100.0, 0.1, -0.5, 0.2])
    _, info = env.reset(seed=1, options={"initial_state": state})
    np.testing.assert_allclose(info["estimate"], info["true_state"], atol=1e-9)
    flown = propagate(
        state, scenario.dt_s * np.arange(90), dynamics="yamanaka_ankersen", orbit=scenario.orbit, spacecraft=NO_AIR
    )
    for step in range(1, 90):
        _, _, _, _, info = env.step(np.zeros((3, 3)))
        np.testing.assert_allclose(info["true_state"][2], flown[step], rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(info["estimate"], info["true_state"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("policy", ["lqr", "smc"])
def test_policies_gain_by_the_right_model(policy: str) -> None:
    """About an ellipse of e = 0.1 HCW in the filter and in the law costs more, seed by seed."""
    right = load_scenario("keeping_eccentric")
    wrong = dataclasses.replace(right, filter=KalmanFilter(dynamics="hcw"))
    costs = [
        -evaluate(make_policy(policy, scenario), scenario, seeds("test", 16))["return"] for scenario in (right, wrong)
    ]
    assert (costs[1] > 1.5 * costs[0]).all()
