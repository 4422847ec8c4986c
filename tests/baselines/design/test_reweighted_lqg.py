"""The regulator of least expected cost: its covariances against theory and flight, its cost against the optimum."""

import dataclasses

import numpy as np
import pytest
from oracles import filter_covariance
from scipy.optimize import linprog
from scipy.sparse import coo_matrix, csr_matrix, eye, hstack, kron, vstack

from baselines import make_policy
from baselines.design.phase_tables import nominal_start, start_error
from baselines.design.reweighted_lqg import (
    Knowledge,
    ReweightedLQGSettings,
    error_weights,
    knowledge,
    reweighted_gains,
    spread,
)
from formation_env import FormationVectorEnv, load_scenario
from formation_env.dropout import NoDropout
from formation_env.evaluation.rollout import evaluate
from formation_env.navigation.sensor import Sensor
from formation_env.task.phases import Start
from formation_env.task.reward import Reward
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, column, leg_reference, legs


def test_knowledge_settles_at_the_riccati_equation() -> None:
    """After two orbits the filter's covariance is the stationary one (Ma 2009, eq. 4.69-4.75), for either sensor."""
    keeping = dataclasses.replace(load_scenario("keeping"), process_noise_m_s2=1e-4)
    for measures, count in (("position_and_velocity", 6), ("position", 3)):
        scenario = dataclasses.replace(keeping, sensor=Sensor(measures=measures))
        model, H = scenario.filter_dynamics(), np.eye(count, 6)
        R_noise = np.diag(np.repeat([2.0, 0.02], 3)[:count] ** 2)
        P = filter_covariance(model.Phi, 1e-4 * model.Gamma, H, R_noise)
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R_noise)
        known = knowledge(scenario, model)
        np.testing.assert_allclose(known.missed[-1], (np.eye(6) - gain @ H) @ P, rtol=1e-3, atol=1e-9)
        np.testing.assert_allclose(known.learned[-1], gain @ H @ P, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("dt_s", [2.0, 30.0])
def test_a_perfect_sensor_leaves_nothing_unknown(dt_s: float) -> None:
    """With R_noise = 0 each measurement is the state: missed is 0, learned what the process noise was (eq. 4.75).

    Q_noise = Gamma Gamma' sigma^2 has rank 3, so S can hardly be inverted; 1e-7 m of rounding is left at most.
    """
    scenario = dataclasses.replace(
        load_scenario("keeping"),
        dt_s=dt_s,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        process_noise_m_s2=1e-3,
    )
    model = scenario.filter_dynamics()
    known = knowledge(scenario, model)
    assert np.abs(known.missed).max() < 1e-14
    Q_noise = 1e-6 * model.Gamma @ model.Gamma.T
    np.testing.assert_allclose(
        known.learned[1:], np.tile(Q_noise, (scenario.num_steps, 1, 1)), atol=1e-9 * Q_noise.max()
    )
    assert np.isfinite(reweighted_gains(scenario, ReweightedLQGSettings(rounds=0))[0]).all()


def test_phases_weigh_errors_as_the_environment_scores_them() -> None:
    """Together the phases weigh each instant once, as the schedule does; none weighs its first, which it cannot change.

    The first instant of a phase ends a step of the phase before (the first of all ends none), whatever errors on the
    way cost.
    """
    mission = load_scenario("mission")
    scenario = dataclasses.replace(mission, reward=Reward(error_weight=0.02, transfer_error_weight=0.003))
    total = np.zeros(scenario.num_steps + 1)
    for leg in legs(scenario):
        weights = error_weights(scenario, leg)
        assert weights[0] == 0
        total[leg.start : leg.end + 1] += weights
    np.testing.assert_array_equal(total, column(build_schedule(scenario), "error_weight"))


def test_predicted_scatter_is_what_is_flown() -> None:
    """Root mean squares of thrust and error at every step, over 1000 flights without dropout.

    A mean square of 1000 Gaussian vectors scatters by 4.5 % at most (one axis alone), a root by 2.2 %: 10 % is over 4.
    """
    scenario = dataclasses.replace(load_scenario("initialization"), dropout=NoDropout())
    scenario = dataclasses.replace(scenario, spacecraft=dataclasses.replace(scenario.spacecraft, max_accel_m_s2=0.05))
    leg, model, rows = legs(scenario)[0], scenario.filter_dynamics().steps(0, scenario.num_steps), 1000
    known = knowledge(scenario, model)
    gains = reweighted_gains(scenario)[0]
    predicted = spread(
        model, gains, start_error(scenario, leg), known.learned[0], Knowledge(known.missed, known.learned)
    )
    policy, env = make_policy("lqr", scenario), FormationVectorEnv(rows, scenario)
    reference = leg_reference(scenario, leg, np.arange(leg.end + 1))
    observation, info = env.reset(seed=0)
    for step in range(leg.end - 1):
        error = np.linalg.norm(info["true_state"][:, :3] - reference[step, :3], axis=1)
        assert np.sqrt(np.mean(error**2)) == pytest.approx(predicted.error[step], rel=0.1)
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        thrust = np.linalg.norm(info["accel_m_s2"], axis=1)
        assert np.sqrt(np.mean(thrust**2)) == pytest.approx(predicted.control[step], rel=0.1, abs=1e-6)


def certain(name: str) -> Scenario:
    """The scenario without any randomness."""
    scenario = load_scenario(name)
    return dataclasses.replace(
        scenario,
        dropout=NoDropout(),
        process_noise_m_s2=0.0,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        start=Start(formation=scenario.start.formation, initial_sigma_pos_m=0.0, initial_sigma_vel_m_s=0.0),
    )


def least_cost(scenario: Scenario) -> float:
    """Least cost of a scenario with one phase and no randomness, m/s, by linear programming.

    Thrust and error are made of vectors along 206 directions, which costs up to 1 % more than their lengths.
    """
    leg, model = legs(scenario)[0], scenario.filter_dynamics()
    i = np.arange(200) + 0.5
    polar, azimuth = np.arccos(1 - i / 100), np.pi * (1 + 5**0.5) * i
    sphere = np.c_[np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)]
    directions = np.vstack([sphere, np.eye(3), -np.eye(3)]).T
    steps, judged = leg.end, range(leg.arrival + 1, leg.end + 1)
    powers = [np.linalg.matrix_power(model.Phi, k) for k in range(steps + 1)]
    effect = [(powers[k] @ model.Gamma)[:3] for k in range(steps)]
    # e_j = coast_j + sum over k < j of effect[j - 1 - k] u_k
    rows = [np.hstack([*(effect[j - 1 - k] for k in range(j)), np.zeros((3, 3 * (steps - j)))]) for j in judged]
    reference = leg_reference(scenario, leg, np.array(judged))
    coast = np.array([(powers[j] @ nominal_start(scenario, leg))[:3] for j in judged]) - reference[:, :3]
    thrusts, errors = kron(eye(steps), directions), kron(eye(len(judged)), directions)
    no_error = csr_matrix((3 * steps, errors.shape[1]))
    axes = hstack([thrusts, no_error]).tocsr()
    price = scenario.reward.error_weight * scenario.dt_s / scenario.hold_s
    result = linprog(
        np.concatenate([np.full(thrusts.shape[1], scenario.dt_s), np.full(errors.shape[1], price)]),
        A_eq=1e-2 * hstack([coo_matrix(np.vstack(rows)) @ thrusts, -errors]).tocsr(),
        b_eq=-1e-2 * coast.ravel(),
        A_ub=vstack([axes, -axes]),
        b_ub=np.full(6 * steps, scenario.spacecraft.max_accel_m_s2),
        method="highs",
    )
    assert result.success
    return float(result.fun)


def test_cost_is_near_the_least_possible() -> None:
    """With nothing random, the flown cost is within 4 % of the optimum; it cannot beat it beyond the oracle's 1 %."""
    scenario = dataclasses.replace(certain("initialization"), dynamics="hcw", dt_s=60.0)
    flown = -float(evaluate(make_policy("lqr", scenario), scenario, [0])["return"][0])
    assert 0.985 < flown / least_cost(scenario) < 1.04
