"""Where the compiled filter goes: to python-control's gains with its own model, and astray with a wrong one."""

import dataclasses
import itertools

import numpy as np
import pytest
from env_helpers import Array, covariances, fly_rows
from oracles import filter_covariance, hcw_state_matrix
from scipy.linalg import expm

from baselines import stationary_filter
from formation_env import FormationVectorEnv, Scenario, load_scenario
from formation_env.dropout import NoDropout
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.orbital.orbit import Orbit

ROWS, STEPS = 256, 120


def steady(name: str, **changes: object) -> Scenario:
    """A shipped scenario without losses and thrust noise."""
    scenario = load_scenario(name)
    craft = dataclasses.replace(scenario.spacecraft, thrust_noise=0.0)
    return dataclasses.replace(scenario, **{"dropout": NoDropout(), "spacecraft": craft, **changes})


SETTLING = {
    "keeping": steady("keeping"),
    "carrier phase": steady("carrier_phase_gps"),
    "strong process noise": steady("keeping", process_noise_m_s2=1e-3),
    "position only": steady("keeping", sensor=Sensor(measures="position"), process_noise_m_s2=1e-4),
    "own beliefs": steady("keeping", filter=KalmanFilter(dynamics="hcw", process_noise_m_s2=1e-4, sigma_pos_m=3.0)),
}


@pytest.mark.parametrize("scenario", SETTLING.values(), ids=SETTLING.keys())
def test_compiled_filter_settles_at_python_controls_covariance(scenario: Scenario) -> None:
    """After 350 measurements the kernel's P is that of control.dlqe, by sigma to 1e-5, whatever the measurements were.

    The slowest of the filters forgets its start with a time constant of 37 measurements.
    """
    env = FormationVectorEnv(2, scenario)
    observation_free = np.zeros((350, 2, 3), np.float32)
    fly_rows(env, observation_free, seed=0)
    limit = stationary_filter(scenario).updated
    sigma = np.sqrt(np.diag(limit))
    for P in covariances(env):
        np.testing.assert_allclose(P / np.outer(sigma, sigma), limit / np.outer(sigma, sigma), atol=1e-5)


@pytest.mark.parametrize("scenario", SETTLING.values(), ids=SETTLING.keys())
def test_stationary_gain_agrees_with_the_doubling_algorithm(scenario: Scenario) -> None:
    """K = P H' (H P H' + R)^-1 with P by doubling, dual to the regulator's (Ma 2009, eq. 4.71)."""
    model, filter_model = scenario.filter_dynamics(), scenario.filter_model
    H = np.eye(6)[: 3 if scenario.sensor.measures == "position" else 6]
    R_noise = np.diag(np.repeat([filter_model.sigma_pos_m, filter_model.sigma_vel_m_s], 3)[: len(H)] ** 2)
    P = filter_covariance(model.Phi, filter_model.process_noise_m_s2 * model.Gamma, H, R_noise)
    ours = stationary_filter(scenario)
    sigma = np.sqrt(np.diag(P))
    np.testing.assert_allclose(ours.predicted, P, rtol=0, atol=1e-6 * np.outer(sigma, sigma).max())
    expected = P @ H.T @ np.linalg.inv(H @ P @ H.T + R_noise)
    unit = sigma[:, None] / np.sqrt(np.diag(R_noise))
    np.testing.assert_allclose(ours.gain / unit, expected / unit, atol=1e-6)


@pytest.mark.parametrize("dt_s", [1.0, 10.0, 600.0])
@pytest.mark.parametrize("altitude_m", [200e3, 20000e3])
def test_filter_settles_at_any_noise_and_step(dt_s: float, altitude_m: float) -> None:
    """90 combinations, of which every tenth failed in SI units: P = Phi (P - K H P) Phi' + Q_noise to 1e-9."""
    scenario = dataclasses.replace(steady("keeping", dynamics="hcw"), dt_s=dt_s, orbit=Orbit(altitude_m=altitude_m))
    for noise, sigma_pos_m, sigma_vel_m_s in itertools.product((1e-9, 1e-5, 0.1), (1e-3, 0.1, 1e3), (None, 1e-5, 0.02)):
        measures = "position_and_velocity" if sigma_vel_m_s else "position"
        sensor = Sensor(measures=measures, sigma_pos_m=sigma_pos_m, sigma_vel_m_s=sigma_vel_m_s or 1.0)
        case = dataclasses.replace(scenario, process_noise_m_s2=noise, sensor=sensor)
        settled, model = stationary_filter(case), case.filter_dynamics()
        sigma = np.sqrt(np.diag(settled.predicted))
        again = model.Phi @ settled.updated @ model.Phi.T + noise**2 * model.Gamma @ model.Gamma.T
        np.testing.assert_allclose((again - settled.predicted) / np.outer(sigma, sigma), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "key"),
    [({"process_noise_m_s2": 0.0}, "process_noise_m_s2"), ({"sensor": Sensor(sigma_pos_m=0.0)}, "sigma")],
)
def test_without_noise_nothing_settles(changes: dict[str, object], key: str) -> None:
    """The error names what is missing."""
    with pytest.raises(ValueError, match=f"{key}: must be > 0 for a stationary filter, got 0"):
        stationary_filter(steady("keeping", **changes))


def expected_nis(scenario: Scenario, truth: Array, believed: Array, push: Array) -> Array:
    """Mean normalised innovation squared (STEPS + 1,) of a filter with a transition matrix that is not the truth's.

    By the moments of truth and estimate together, eq. (4.69-4.75) written out for twelve states; both are linear.

    Args:
        scenario: noises, and the start.
        truth: transition matrix of a step.
        believed: the filter's.
        push: effect (6, 3) of an acceleration over a step, on the truth and as believed.
    """
    sensor, start, identity = scenario.sensor, scenario.start, np.eye(6)
    R_noise = np.diag(np.repeat([sensor.sigma_pos_m, sensor.sigma_vel_m_s], 3) ** 2)
    Q_noise = scenario.process_noise_m_s2**2 * push @ push.T
    P = np.diag(np.repeat([start.initial_sigma_pos_m, start.initial_sigma_vel_m_s], 3) ** 2)
    mean = np.tile(start.formation.state(scenario.orbit), 2)
    joint = np.zeros((12, 12))
    joint[:6, :6] = P
    see, result = np.hstack([identity, -identity]), []
    for _ in range(STEPS + 1):
        S = P + R_noise
        innovation = see @ (joint + np.outer(mean, mean)) @ see.T + R_noise
        result.append(np.trace(np.linalg.solve(S, innovation)))
        K = P @ np.linalg.inv(S)
        update = np.block([[identity, 0 * identity], [K, identity - K]])
        joint = update @ joint @ update.T
        joint[6:, 6:] += K @ R_noise @ K.T
        step = np.block([[truth, 0 * identity], [0 * identity, believed]])
        mean, joint = step @ update @ mean, step @ joint @ step.T
        joint[:6, :6] += Q_noise
        P = believed @ (P - K @ S @ K.T) @ believed.T + Q_noise
    return np.array(result)


WRONG = {
    "right": (KalmanFilter(), 600e3),
    "wrong orbit": (KalmanFilter(orbit=Orbit(altitude_m=620e3)), 620e3),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_model_shows_in_the_innovations(case: str) -> None:
    """NIS of 256 rows at every instant against the mean that linear theory gives: 6 with the right model, else more.

    The leader's orbit is believed 20 km too high, so n is 0.4 % too low. The band is 5 standard errors of the rows'
    scatter; of 121 values a correct program has one outside with probability 1e-4.
    """
    filter_model, altitude_m = WRONG[case]
    scenario = steady("keeping", dynamics="hcw", filter=filter_model)
    motions = [np.sqrt(3.986004391e14 / (6378136.6 + height) ** 3) for height in (600e3, altitude_m)]
    truth, believed = (expm(hcw_state_matrix(n) * scenario.dt_s) for n in motions)
    # the integral of exp(A t) B over the step, by Simpson's rule; 20 km make no difference to it
    push = sum(
        weight * scenario.dt_s / 6 * expm(hcw_state_matrix(motions[0]) * share * scenario.dt_s)[:, 3:]
        for weight, share in ((1, 0.0), (4, 0.5), (1, 1.0))
    )
    expected = expected_nis(scenario, truth, believed, np.asarray(push))
    flown = fly_rows(FormationVectorEnv(ROWS, scenario), np.zeros((STEPS, ROWS, 3), np.float32), seed=3)
    nis = np.array([result[-1]["nis"] for result in flown])
    z = (nis.mean(axis=1) - expected) / (nis.std(axis=1) / np.sqrt(ROWS))
    assert np.abs(z).max() < 5
    if case == "right":
        np.testing.assert_allclose(expected, 6, rtol=1e-6)
    else:
        assert expected[60:].mean() > 12
