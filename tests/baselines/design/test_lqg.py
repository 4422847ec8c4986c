"""LQG: filter and regulator together against the covariance that linear theory gives."""

import dataclasses

import numpy as np
from oracles import filter_covariance
from scipy.linalg import solve_discrete_lyapunov

from baselines import make_policy
from formation_env import FormationVectorEnv, load_scenario
from formation_env.dropout import NoDropout
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

HOLD = {"position": [1.0, 1.0, 1.0], "velocity_s2": [1e4, 1e4, 1e4], "control_s2": [1e3, 1e3, 1e3]}
SIGMA_W = 2e-4


def linear_regime() -> Scenario:
    """Keeping by HCW truth without dropout, noisy, and with thrust to spare."""
    return dataclasses.replace(
        load_scenario("keeping"),
        dynamics="hcw",
        dropout=NoDropout(),
        process_noise_m_s2=SIGMA_W,
        spacecraft=Spacecraft(max_accel_m_s2=1.0),
    )


def joint_covariance(scenario: Scenario, K: Array) -> Array:
    """Stationary covariance (12, 12) of the error and of the estimate's error, just after a measurement.

    e(k+1) = (Phi - G K) e + G K x~ + G w and x~(k+1) = (I - L) (Phi x~ + G w) - L v, with x~ = e - e_hat, L the
    stationary Kalman gain, w and v the noises (Ma 2009, eq. 4.69-4.75).
    """
    model, sensor, identity = scenario.filter_dynamics(), scenario.sensor, np.eye(6)
    Phi, G = model.Phi, model.Gamma
    R_noise = np.diag(np.repeat([sensor.sigma_pos_m, sensor.sigma_vel_m_s], 3) ** 2)
    P = filter_covariance(Phi, SIGMA_W * G, identity, R_noise)
    L = P @ np.linalg.inv(P + R_noise)
    loop = np.block([[Phi - G @ K, G @ K], [np.zeros((6, 6)), (identity - L) @ Phi]])
    push = np.vstack([G, (identity - L) @ G])
    shake = np.vstack([np.zeros((6, 6)), -L])
    return solve_discrete_lyapunov(loop, SIGMA_W**2 * push @ push.T + shake @ R_noise @ shake.T)


def test_lqg_covariance_is_the_lyapunov_equations() -> None:
    """Mean squares over 512 rows of 150 instants each; the band is 4.5 standard errors, taken from the rows' scatter.

    The rows are independent; with 12 + 3 values a correct program fails with probability 1e-4.
    """
    scenario = linear_regime()
    policy, rows = make_policy("lqr", scenario, {"design": "weights", "hold": HOLD}), 512
    env = FormationVectorEnv(rows, scenario)
    reference = scenario.phases[0].formation.reference(scenario.dt_s * np.arange(301), scenario.orbit)
    observation, _ = env.reset(seed=0)
    squares = []
    for step in range(1, 301):
        action = policy.predict(observation)[0]
        observation, _, _, _, info = env.step(action)
        error = info["true_state"] - reference[step]
        missed = info["true_state"] - info["estimate"]
        if step > 150:  # the loop's slowest time constant is 300 s, 10 steps
            squares.append(np.hstack([error, missed, info["accel_m_s2"]]) ** 2)
    means = np.mean(squares, axis=0)
    K = policy.K[0, 1]
    joint = joint_covariance(scenario, K)
    seen = np.hstack([-K, K])  # u = -K (e - x~)
    expected = np.concatenate([np.diag(joint), np.diag(seen @ joint @ seen.T)])
    z = (means.mean(axis=0) - expected) / (means.std(axis=0) / np.sqrt(rows))
    assert np.abs(z).max() < 4.5, z
