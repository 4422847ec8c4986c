"""Finite horizons: Riccati's differential equation and its adjoint, against closed forms and brute force."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from env_helpers import noise_free
from oracles import hcw_state_matrix
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, cholesky, expm, solve_continuous_are

from baselines import make_policy
from baselines.design.guidance import desired_path
from baselines.design.riccati import integrate_tracking, time_varying_gains
from formation_env import FormationEnv, Scenario, Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.task.schedule import leg_reference, legs

N = 1.083e-3
A, B = hcw_state_matrix(N), np.eye(6)[:, 3:]
Q = np.diag([1.0, 2.0, 3.0, 1e4, 1e4, 2e4])
R = 1e8 * np.diag([1.0, 0.5, 2.0])
"""A loop with time constants of about 100 s."""


@pytest.mark.parametrize("terminal", [0.0, 5.0])
def test_scalar_horizon_is_the_closed_form(terminal: float) -> None:
    """x' = a x + b u: P of Ma 2009, eq. (4.13-4.14), is a fraction of hyperbolic functions of the time to go.

    P = (S (w cosh + a sinh) + q sinh) / (w cosh + (S b^2 / r - a) sinh), w^2 = a^2 + b^2 q / r, of w (t_f - t), S the
    terminal weight; the integrator works to 1e-8.
    """
    a, b, q, r = 0.3, 2.0, 1.5, 0.8
    times, w = np.linspace(0, 2.5, 11), np.sqrt(0.3**2 + 2.0**2 * 1.5 / 0.8)
    c, s = np.cosh(w * (2.5 - times)), np.sinh(w * (2.5 - times))
    expected = (terminal * (w * c + a * s) + q * s) / (w * c + (terminal * b**2 / r - a) * s)
    scalars = (np.array([[value]]) for value in (a, b, q, r))
    P, _ = integrate_tracking(*scalars, times, np.zeros((11, 1)), np.array([[terminal]]), np.zeros(1))
    np.testing.assert_allclose(P[:, 0, 0], expected, rtol=1e-6, atol=1e-7)


def test_long_horizon_forgets_its_end() -> None:
    """Fifteen time constants from the end P is scipy's solution of the algebraic equation (4.18), whatever the end."""
    expected = solve_continuous_are(A, B, Q, R)
    times_s = np.array([0.0, 4000.0])
    for P_end in (np.zeros((6, 6)), 3 * expected):
        P, g = integrate_tracking(A, B, Q, R, times_s, np.zeros((2, 6)), P_end, np.zeros(6))
        np.testing.assert_allclose(P[0], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
        assert (g == 0).all()


def test_cost_to_go_is_the_flights_cost() -> None:
    """x0' P(0) x0 is the integral of x' Q x + u' R u plus the terminal weight, flown by eq. (4.11-4.12).

    P is linear between instants 2 s apart here, 1/50 of a time constant: 1e-4 of the cost.
    """
    times_s, P_end, start = np.linspace(0, 300, 151), 1e3 * np.eye(6), np.array([100.0, -50, 30, 0.2, 0.1, -0.4])
    P, _ = integrate_tracking(A, B, Q, R, times_s, np.zeros((151, 6)), P_end, np.zeros(6))

    def rates(time_s: float, state: Array) -> Array:
        now = np.array([np.interp(time_s, times_s, column) for column in P.reshape(151, 36).T]).reshape(6, 6)
        x = state[:6]
        u = -np.linalg.solve(R, B.T @ now @ x)
        return np.append(A @ x + B @ u, x @ Q @ x + u @ R @ u)

    end = solve_ivp(rates, (0, 300), np.append(start, 0), rtol=1e-8, atol=1e-8, max_step=10).y[:, -1]
    assert start @ P[0] @ start == pytest.approx(end[6] + end[:6] @ P_end @ end[:6], rel=1e-4)


def brute_force(
    Phi: Array, Gamma: Array, states: list[Array], controls: list[Array], start: Array, wanted: Array
) -> tuple[Array, float]:
    """Controls (steps, 3), and cost, of the least squares problem in all controls at once.

    Args:
        Phi: transition matrix of a step.
        Gamma: input matrix of a step.
        states: weights (6, 6) of the first state to the last, steps + 1.
        controls: weights (3, 3), steps.
        start: first state.
        wanted: desired states (steps + 1, 6).
    """
    count = len(controls)
    powers = [np.linalg.matrix_power(Phi, k) for k in range(count + 1)]
    effect = np.zeros((6 * (count + 1), 3 * count))
    for row in range(1, count + 1):
        for column in range(row):
            effect[6 * row : 6 * row + 6, 3 * column : 3 * column + 3] = powers[row - 1 - column] @ Gamma
    free = np.concatenate([power @ start for power in powers])
    root = block_diag(*(cholesky(weight) for weight in states))
    stacked = np.vstack([root @ effect, block_diag(*(cholesky(weight) for weight in controls))])
    goal = np.concatenate([root @ (wanted.ravel() - free), np.zeros(3 * count)])
    # a unit of control that costs one, for the solver's conditioning
    unit = np.repeat(1 / np.sqrt([np.trace(weight) for weight in controls]), 3)
    scaled = np.linalg.lstsq(stacked * unit, goal, rcond=None)[0]
    return (unit * scaled).reshape(count, 3), float(((stacked * unit @ scaled - goal) ** 2).sum())


def step_matrices(dt_s: float) -> tuple[Array, Array]:
    """Zero-order hold of HCW."""
    both = expm(np.block([[A, B], [np.zeros((3, 9))]]) * dt_s)
    return both[:6, :6], both[:6, 6:]


def test_discrete_recursion_is_the_optimum_of_the_stacked_problem() -> None:
    """Weights on the way that change from step to step: the recursion's controls are the least squares solution's."""
    Phi, Gamma = step_matrices(20.0)
    rng, count, start = np.random.default_rng(5), 25, np.array([300.0, -200, 100, 0.5, 0.3, -0.2])
    states = [factor * Q for factor in rng.uniform(0.2, 5, count + 1)]
    controls = [factor * R for factor in rng.uniform(0.2, 5, count)]
    expected, _ = brute_force(Phi, Gamma, states, controls, start, np.zeros((count + 1, 6)))
    state = start
    for K, control in zip(time_varying_gains(Phi, Gamma, np.array(states), np.array(controls)), expected, strict=True):
        np.testing.assert_allclose(-K @ state, control, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
        state = Phi @ state + Gamma @ control


def wave(times_s: Array) -> Array:
    """A desired state that the follower could not follow without thrust."""
    phase = times_s / 80.0
    place = np.stack([100 * np.sin(phase), 2 * times_s, 50 * np.cos(2 * phase)], axis=-1)
    velocity = np.stack([1.25 * np.cos(phase), 0 * phase + 2, -1.25 * np.sin(2 * phase)], axis=-1)
    return np.hstack([place, velocity])


def test_integrated_pull_gives_the_optimum_of_the_tracking_problem() -> None:
    """The least of (4.16) with a terminal weight, by brute force in steps of 4, 2 and 1 s: they come nearer with dt.

    The first control is held over the first step, so it is the continuous one in its middle: to second order of dt over
    the time constant of 100 s. From 1e-3 on the wave's interpolation is seen.
    """
    end_s, P_end, start = 400.0, 1e4 * np.eye(6), np.array([30.0, -80, 10, 0.0, 0.5, 0.2])
    times_s = np.arange(0, 2 * end_s + 1) / 2
    P, g = integrate_tracking(A, B, Q, R, times_s, wave(times_s), P_end, P_end @ wave(times_s[-1:])[0])
    size = np.abs(np.linalg.solve(R, B.T @ (g[0] - P[0] @ start))).max()
    differences = []
    for dt_s in (4.0, 2.0, 1.0):
        Phi, Gamma = step_matrices(dt_s)
        count = round(end_s / dt_s)
        # trapezoidal rule: half a weight at both ends
        states = [0.5 * dt_s * Q, *[dt_s * Q] * (count - 1), 0.5 * dt_s * Q + P_end]
        controls, _ = brute_force(Phi, Gamma, states, [dt_s * R] * count, start, wave(dt_s * np.arange(count + 1)))
        middle = round(dt_s)  # of the instants 0.5 s apart
        x = expm(A * dt_s / 2) @ start + step_matrices(dt_s / 2)[1] @ controls[0]
        ours = np.linalg.solve(R, B.T @ (g[middle] - P[middle] @ x))
        differences.append(np.abs(ours - controls[0]).max() / size)
    assert differences[0] > differences[1] > differences[2]
    assert differences[2] < 1e-3


WEIGHTS = {"position": [1.0, 1, 1], "velocity_s2": [1e4, 1e4, 1e4], "control_s2": [100.0, 100, 100]}


def flown_cost(scenario: Scenario, feedforward: str, price: Callable[[Array, Array], float]) -> float:
    """Cost of flying a straight line with `lqr_quasi_static`."""
    gains = {"guidance": "straight_line", "feedforward": feedforward, "hold": WEIGHTS, "transfer": WEIGHTS}
    policy, env = make_policy("lqr_quasi_static", scenario, gains), FormationEnv(scenario)
    observation, info = env.reset(seed=0)
    states, controls = [info["true_state"]], []
    for _ in range(scenario.num_steps):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        states.append(info["true_state"])
        controls.append(info["accel_m_s2"])
    return price(np.array(states), np.array(controls))


def test_tracker_with_integrated_pull_flies_the_optimum() -> None:
    """No lag: the flight's cost is within 1 % of the least that brute force finds; the quasi-static law's is far off.

    The end is weighed by the infinite horizon's cost-to-go (scipy). The gains are those of each step's beginning, 10 s
    against time constants of 100 s: an error of first order in u, of second order in the cost.
    """
    craft = Spacecraft(max_accel_m_s2=1.0)
    scenario = dataclasses.replace(noise_free("initialization"), dynamics="hcw", dt_s=10.0, spacecraft=craft)
    n, leg = scenario.orbit.mean_motion_rad_s, legs(scenario)[0]
    way = desired_path(scenario, leg, "straight_line")
    wanted = np.vstack([way, leg_reference(scenario, leg, np.arange(len(way), leg.end + 1))])
    Q_line, R_line = np.diag(np.repeat([1.0, 1e4], 3)), np.eye(3) * 100 / n**2
    P_end = solve_continuous_are(hcw_state_matrix(n), B, Q_line, R_line)
    model, count = scenario.filter_dynamics(), scenario.num_steps

    def price(states: Array, controls: Array) -> float:
        error = states - wanted
        way_cost = 10.0 * (np.einsum("ti,ij,tj", error[:-1], Q_line, error[:-1]) + (controls @ R_line * controls).sum())
        return float(way_cost + error[-1] @ P_end @ error[-1])

    states = [*[10.0 * Q_line] * count, P_end]
    _, least = brute_force(model.Phi, model.Gamma, states, [10.0 * R_line] * count, np.zeros(6), wanted)
    assert 1.0 <= flown_cost(scenario, "integrated", price) / least < 1.01
    assert flown_cost(scenario, "quasi_static", price) / least > 10
