"""Regulators: their gains against scipy's Riccati solvers, and what a finite horizon and renewed weights do."""

import dataclasses

import numpy as np
import pytest
from oracles import regulator_cost
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from scipy.optimize import linprog
from scipy.sparse import eye, kron, vstack

from baselines import make_policy
from baselines.controllers.lqr_quasi_static import tracking_gains
from baselines.controllers.weights import Weights
from baselines.design.guidance import least_fuel_path
from baselines.design.phase_tables import nominal_start
from baselines.design.riccati import continuous_gain, finite_horizon_gains, stationary
from formation_env import load_scenario
from formation_env.dynamics import HCW, ModifiedHCW
from formation_env.dynamics.base import control_matrix
from formation_env.dynamics.hcw import transition_matrix
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, legs

# The thesis's weights, and weights of a slow loop that values velocities.
WEIGHTS = (
    Weights(control_s2=(12000.0, 12000.0, 12000.0)),
    Weights(position=(1.0, 2.0, 3.0), velocity_s2=(1e5, 2e5, 3e4), control_s2=(3e5, 1e5, 1e6)),
)


@pytest.fixture(params=WEIGHTS, ids=["thesis", "slow"])
def weights(request: pytest.FixtureRequest) -> Weights:
    return request.param


@pytest.mark.parametrize("dt_s", [1.0, 30.0])
def test_discrete_gain_agrees_with_the_doubling_algorithm(weights: Weights, dt_s: float) -> None:
    """K = (R + G' P G)^-1 G' P Phi with P by doubling; 1e-6 allows for the equation's condition."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=dt_s)
    model, Q, R = scenario.filter_dynamics(), weights.Q(), weights.R(scenario.orbit)
    P = regulator_cost(model.Phi, model.Gamma, Q, R)
    expected = np.linalg.solve(R + model.Gamma.T @ P @ model.Gamma, model.Gamma.T @ P @ model.Phi)
    np.testing.assert_allclose(stationary(model.Phi, model.Gamma, Q, R)[0], expected, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("dt_s", [0.5, 1.0, 2.0, 2.5])
@pytest.mark.parametrize("control_s2", [0.5, 12000.0, 200000.0])
def test_discrete_gain_of_short_steps_is_the_continuous_one(dt_s: float, control_s2: float) -> None:
    """At steps far below the loop's time constant, also at those where the solver would fail in SI units.

    A step is a delay of T/2, worth w T to the gains, with w = n^(1/2) a^(-1/4); twice that is allowed.
    """
    scenario = dataclasses.replace(load_scenario("thesis_keeping"), dt_s=dt_s)
    weights = Weights(control_s2=(control_s2, control_s2, control_s2))
    A, B = ModifiedHCW().state_matrix(scenario.orbit, scenario.spacecraft), control_matrix()
    model, Q, R = scenario.filter_dynamics(), weights.Q(), weights.R(scenario.orbit)
    expected = continuous_gain(A, B, Q, R)[0]
    w = (scenario.orbit.mean_motion_rad_s**2 / control_s2) ** 0.25
    K = stationary(model.Phi, model.Gamma, Q, R)[0]
    np.testing.assert_allclose(K, expected, rtol=2 * w * dt_s, atol=2 * w * dt_s * np.abs(expected).max() / 10)


def test_continuous_gain_agrees_with_scipy(weights: Weights) -> None:
    """K = R^-1 B' P (Ma 2009, eq. 4.12, 4.18) with P of scipy's Riccati solver."""
    scenario = load_scenario("keeping")
    A, B = ModifiedHCW().state_matrix(scenario.orbit, scenario.spacecraft), control_matrix()
    Q, R = weights.Q(), weights.R(scenario.orbit)
    P = solve_continuous_are(A, B, Q, R)
    K, ours = continuous_gain(A, B, Q, R)
    np.testing.assert_allclose(ours, P, rtol=1e-6, atol=1e-6 * np.abs(P).max())
    np.testing.assert_allclose(K, np.linalg.solve(R, B.T @ P), rtol=1e-6, atol=1e-12)


def test_quasi_static_feedforward_is_the_limit_of_the_tracking_equation(weights: Weights) -> None:
    """For a constant y_d, g' = -(A - B K)' g - Q y_d, run backwards from 0, settles at the g of Ma 2009, eq. (4.19)."""
    scenario = dataclasses.replace(load_scenario("keeping"), dynamics="hcw")
    A, B = HCW().state_matrix(scenario.orbit, scenario.spacecraft), control_matrix()
    Q, R = weights.Q(), weights.R(scenario.orbit)
    K, K_desired = (gains[0] for gains in tracking_gains(scenario, weights))
    desired = np.array([100.0, 200.0, -300.0, 0.1, -0.2, 0.3])
    loop = (A - B @ K).T
    slowest_s = -1 / np.linalg.eigvals(loop).real.max()
    path = solve_ivp(
        lambda _, g: loop @ g + Q @ desired, (0, 30 * slowest_s), np.zeros(6), method="LSODA", rtol=1e-9, atol=1e-6
    )
    # e^-30 is left of the transient; the integrator's error is what is seen
    np.testing.assert_allclose(K_desired @ desired, np.linalg.solve(R, B.T @ path.y[:, -1]), rtol=1e-5, atol=1e-10)


def test_long_finite_horizon_is_the_infinite_one(weights: Weights) -> None:
    """Far from the end the backward Riccati recursion (Ma 2009, eq. 4.12-4.14) has forgotten its terminal weight."""
    scenario = load_scenario("keeping")
    model, Q, R = scenario.filter_dynamics(), weights.Q(), weights.R(scenario.orbit)
    gains = finite_horizon_gains(model.Phi, model.Gamma, Q, np.tile(R, (3000, 1, 1)), 10 * Q)
    expected = stationary(model.Phi, model.Gamma, Q, R)[0]
    np.testing.assert_allclose(gains[0], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    assert np.abs(gains[-1] - expected).max() > 0.1 * np.abs(expected).max()


def test_finite_horizon_is_the_least_squares_solution() -> None:
    """Least energy to a terminal state is a least-squares problem in all controls at once; solved here as one."""
    scenario = load_scenario("initialization")
    model, count = scenario.filter_dynamics(), 20
    # units of 1 m and 1 mm/s keep the stacked problem well conditioned
    unit = np.diag([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
    start = np.array([10.0, -2000.0, 5.0, 0.1, 0.0, -0.1])
    to_end = [np.linalg.matrix_power(model.Phi, count - 1 - k) @ model.Gamma for k in range(count)]
    stacked = np.vstack([unit @ np.hstack(to_end), 1e3 * np.eye(3 * count)])
    goal = np.concatenate([-unit @ np.linalg.matrix_power(model.Phi, count) @ start, np.zeros(3 * count)])
    expected = np.linalg.lstsq(stacked, goal, rcond=None)[0].reshape(count, 3)
    gains = finite_horizon_gains(
        model.Phi, model.Gamma, np.zeros((6, 6)), np.tile(1e6 * np.eye(3), (count, 1, 1)), unit @ unit
    )
    state, controls = start, []
    for K in gains:
        controls.append(-K @ state)
        state = model.Phi @ state + model.Gamma @ controls[-1]
    np.testing.assert_allclose(controls, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())


def least_delta_v(scenario: Scenario, leg: Leg) -> float:
    """The least delta-v of a leg's transfer, m/s, by linear programming: thrust along 200 directions, cut at the limit.

    Between two of the directions a burn costs up to 1 % more than it should.
    """
    model, count = scenario.filter_dynamics(), leg.arrival - leg.start
    i = np.arange(200) + 0.5
    polar, azimuth = np.arccos(1 - i / 100), np.pi * (1 + 5**0.5) * i
    sphere = np.c_[np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)]
    directions = np.vstack([sphere, np.eye(3), -np.eye(3)])
    goal = transition_matrix(scenario.orbit.mean_motion_rad_s, 0.0) @ leg.phase.formation.state(scenario.orbit)
    coast = np.linalg.matrix_power(model.Phi, count) @ nominal_start(scenario, leg)
    to_end = [np.linalg.matrix_power(model.Phi, count - 1 - k) @ model.Gamma for k in range(count)]
    rows = 1e-3 * np.repeat([1.0, 1e3], 3)
    axes = kron(eye(count), directions.T).tocsr()
    result = linprog(
        np.ones(count * len(directions)),
        A_eq=rows[:, None] * np.hstack([G @ directions.T for G in to_end]),
        b_eq=rows * (goal - coast),
        A_ub=vstack([axes, -axes]),
        b_ub=np.full(6 * count, scenario.spacecraft.max_accel_m_s2),
        method="highs",
    )
    assert result.success
    return float(result.fun) * scenario.dt_s


@pytest.mark.parametrize("name", ["initialization", "reconfiguration"])
def test_least_fuel_path_is_near_the_linear_programme(name: str) -> None:
    """Renewed weights come within 5 % of the least delta-v, and cannot beat it beyond the 1 % of the oracle."""
    scenario = load_scenario(name)
    leg, model = legs(scenario)[0], scenario.filter_dynamics()
    path = least_fuel_path(scenario, leg)
    jumps = path[1:] - path[:-1] @ model.Phi.T - model.delta
    thrust = jumps @ np.linalg.pinv(model.Gamma).T
    delta_v = scenario.dt_s * float(np.linalg.norm(thrust, axis=1).sum())
    assert 0.98 < delta_v / least_delta_v(scenario, leg) < 1.05
    assert np.abs(thrust).max() < scenario.spacecraft.max_accel_m_s2


def test_renewed_weights_save_fuel_in_flight() -> None:
    """The same regulator with constant weights, least energy, takes a third more fuel to the same place."""
    from formation_env.evaluation.rollout import evaluate

    flown: dict[int, Array] = {}
    for rounds in (0, 30):
        policy = make_policy("lqr", "initialization", {"design": "weights", "transfer": {"rounds": rounds}})
        flown[rounds] = evaluate(policy, "initialization", range(20))["delta_v_m_s"].to_numpy()
    assert flown[0].mean() > 1.3 * flown[30].mean()
