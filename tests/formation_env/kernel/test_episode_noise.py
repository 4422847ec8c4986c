"""Everything random in an episode: its size and its distribution, and whether the filter knows of it.

Seeds are fixed, so a test passes always or never; the bands hold a correct simulation with a probability of 1 - 1e-5.
"""

import dataclasses
from typing import Any

import numpy as np
import pytest
from env_helpers import Array, covariances, fly, fly_rows, noise_free, random_actions, start_spread
from scipy import stats

from formation_env import FormationEnv, FormationVectorEnv, Scenario, Spacecraft, load_scenario, propagate
from formation_env.dropout import Bernoulli, GilbertElliott, NoDropout, Window, Windows
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.task.observation import observation_layout

RISK = 1e-5
ROWS = 256


def collect(results: list[tuple[Any, ...]], key: str) -> Array:
    """One of the infos over (instants, rows, ...)."""
    return np.array([result[-1][key] for result in results])


def assert_chi2(squares: Array, freedom: int) -> None:
    """A sum of independent chi-square variables of `freedom` each lies in its band."""
    low, high = stats.chi2.interval(1 - RISK, freedom * squares.size)
    assert low < squares.sum() < high, f"{squares.sum() / squares.size:.4g} on average, expected {freedom}"


def assert_standard_normal(samples: Array) -> None:
    """Mean, variance and shape of independent standard normals, and no correlation between the columns."""
    columns = samples.reshape(-1, samples.shape[-1])
    for column in columns.T:
        assert stats.kstest(column, "norm").pvalue > RISK
        assert_chi2(column**2, 1)
    correlations = np.atleast_2d(np.corrcoef(columns.T))[np.triu_indices(columns.shape[1], 1)]
    assert (np.abs(correlations) < stats.norm.isf(RISK / 2) / np.sqrt(len(columns))).all()


def assert_probability(successes: int, trials: int, probability: float) -> None:
    """A count lies in its binomial band."""
    assert stats.binomtest(int(successes), int(trials), probability).pvalue > RISK, f"{successes} of {trials}"


def still(rows: int, steps: int) -> Any:
    """No thrust."""
    return np.zeros((steps, rows, 3), np.float32)


def test_start_is_spread_about_the_nominal_state() -> None:
    """Independent normals of the scenario's sigmas on each axis."""
    scenario = load_scenario("reconfiguration")
    infos = FormationVectorEnv(4000, scenario).reset(seed=0)[1]
    error = infos["true_state"] - [0, 5000, 0, 0, 0, 0]
    assert_standard_normal(error / np.repeat([20, 0.02], 3))


def test_given_start_has_an_estimate_about_it_with_the_same_spread() -> None:
    """What the filter believes of its first error is true, whichever of the two is given."""
    scenario = dataclasses.replace(load_scenario("reconfiguration"), dropout=Bernoulli(loss_probability=1.0))
    start = [10, 20, 30, 0.1, 0.2, 0.3]
    infos = FormationVectorEnv(4000, scenario).reset(seed=0, options={"initial_state": start})[1]
    np.testing.assert_array_equal(infos["true_state"], np.tile(start, (4000, 1)))
    assert_standard_normal((infos["estimate"] - start) / np.repeat([20, 0.02], 3))


def test_process_noise_is_a_held_white_acceleration() -> None:
    """What the truth has more than its propagation is Gamma w: dt^2 / 2 and dt times w on each axis.

    The coupling n dt between the axes is 3 %, and is taken along by inverting the six equations for w.
    """
    scenario = dataclasses.replace(noise_free("keeping"), process_noise_m_s2=1e-3)
    results = fly_rows(FormationVectorEnv(ROWS, scenario), still(ROWS, 20), seed=0)
    truth = collect(results, "true_state")
    moved = np.array([propagate(x, [30.0], orbit=scenario.orbit, spacecraft=scenario.spacecraft)[:, 0] for x in truth])
    excess = (truth[1:] - moved[:-1]).reshape(-1, 6)
    # Columns of Gamma: what a unit acceleration along each axis does over a step, by the exact linear model.
    Gamma = scenario.true_dynamics().Gamma
    noise, residual, *_ = np.linalg.lstsq(Gamma, excess.T, rcond=None)
    assert residual.max() < 1e-12
    np.testing.assert_allclose(Gamma[[0, 1, 2], [0, 1, 2]], 30**2 / 2, rtol=1e-3)
    np.testing.assert_allclose(Gamma[[3, 4, 5], [0, 1, 2]], 30, rtol=2e-3)
    assert_standard_normal(noise.T / 1e-3)


def test_sensor_noise_is_normal_with_the_sensors_sigmas() -> None:
    """A filter that knows nothing beforehand takes the first measurement as it is, so its error is the sensor's."""
    ignorant = KalmanFilter(initial_sigma_pos_m=1e5, initial_sigma_vel_m_s=1e3)
    scenario = dataclasses.replace(load_scenario("keeping"), filter=ignorant, dropout=NoDropout())
    infos = FormationVectorEnv(4000, scenario).reset(seed=0)[1]
    assert_standard_normal((infos["estimate"] - infos["true_state"]) / np.repeat([2, 0.02], 3))


def test_thrust_noise_scales_the_magnitude() -> None:
    """The thrust keeps its direction; its relative error is normal. Delta-v is of the thrust that acts."""
    craft = Spacecraft(max_accel_m_s2=0.01, thrust_noise=0.05)
    scenario = dataclasses.replace(noise_free("keeping"), spacecraft=craft)
    actions = random_actions(1, 20, ROWS)
    infos = fly_rows(FormationVectorEnv(ROWS, scenario), actions, seed=0)[1:]
    thrust, delta_v = collect(infos, "accel_m_s2"), collect(infos, "delta_v_m_s")
    ratios = thrust / (0.01 * actions.astype(float))
    np.testing.assert_allclose(ratios, np.broadcast_to(ratios[..., :1], ratios.shape), rtol=1e-9)
    assert_standard_normal((ratios[..., 0].reshape(-1, 1) - 1) / 0.05)
    np.testing.assert_allclose(delta_v, 30 * np.linalg.norm(thrust, axis=-1), rtol=1e-12)


def test_independent_losses_have_their_rate_and_no_memory() -> None:
    """Binomial counts, also right after a loss; and the first instant is like any other."""
    scenario = dataclasses.replace(load_scenario("keeping"), dropout=Bernoulli(loss_probability=0.3))
    lost = ~collect(fly_rows(FormationVectorEnv(ROWS, scenario), still(ROWS, 100), seed=0), "measured")
    assert_probability(lost.sum(), lost.size, 0.3)
    assert_probability(lost[0].sum(), ROWS, 0.3)
    assert_probability((lost[1:] & lost[:-1]).sum(), lost[:-1].sum(), 0.3)


def test_bursts_have_their_mean_length_and_spacing() -> None:
    """Geometric spells: each ends at every step with dt / mean, however long it has lasted.

    At the start the chain is stationary: down with mean outage / (mean outage + mean between).
    """
    scenario = dataclasses.replace(
        load_scenario("keeping"), dropout=GilbertElliott(mean_outage_s=300.0, mean_uptime_orbits=0.2)
    )
    between_s = 0.2 * 2 * np.pi / scenario.orbit.mean_motion_rad_s
    lost = ~collect(fly_rows(FormationVectorEnv(ROWS, scenario), still(ROWS, 380), seed=0), "measured")
    assert_probability(lost[0].sum(), ROWS, 300 / (300 + between_s))
    assert_probability((lost[:-1] & ~lost[1:]).sum(), lost[:-1].sum(), 30 / 300)
    assert_probability((~lost[:-1] & lost[1:]).sum(), (~lost[:-1]).sum(), 30 / between_s)
    long = lost[:-4] & lost[1:-3] & lost[2:-2] & lost[3:-1]
    assert_probability((long & ~lost[4:]).sum(), long.sum(), 30 / 300)
    # Lengths of the outages that begin in the first half, so that hardly any (0.9^190) is cut off by the end.
    edges = np.diff(lost.astype(int), axis=0)
    lengths = [np.argmax(edges[k + 1 :, row] < 0) + 1 for k, row in np.argwhere(edges[:190] > 0)]
    deviation = 300 / 30 * np.sqrt(1 - 0.1) / np.sqrt(len(lengths))
    assert np.mean(lengths) == pytest.approx(10, abs=stats.norm.isf(RISK / 2) * deviation)


def test_windows_are_exact() -> None:
    """Instants within [start, start + duration) have no measurement, all others have one, in every episode."""
    windows = Windows(windows=(Window(start_s=300.0, duration_s=600.0), Window(start_s=1000.0, duration_s=50.0)))
    scenario = dataclasses.replace(load_scenario("keeping"), dropout=windows)
    results = fly_rows(FormationVectorEnv(40, scenario), still(40, 60), seed=0)
    times = 30.0 * np.arange(61)
    closed = ((times >= 300) & (times < 900)) | ((times >= 1000) & (times < 1050))
    np.testing.assert_array_equal(~collect(results, "measured"), np.tile(closed[:, None], (1, 40)))


CONSISTENT = {
    "keeping": load_scenario("keeping"),
    "bad communication": load_scenario("bad_communication"),
    "position only": dataclasses.replace(load_scenario("mission"), sensor=Sensor(measures="position")),
    "carrier phase": start_spread(5.0, 0.01, load_scenario("carrier_phase_gps")),
    "thrust noise": dataclasses.replace(
        load_scenario("keeping"), spacecraft=Spacecraft(max_accel_m_s2=0.002, thrust_noise=0.1)
    ),
    "strong process noise": dataclasses.replace(load_scenario("bx1_companion"), process_noise_m_s2=1e-3),
}


@pytest.mark.parametrize("scenario", CONSISTENT.values(), ids=CONSISTENT.keys())
def test_filter_is_consistent(scenario: Scenario) -> None:
    """NEES e' P^-1 e is chi-square of 6 over rows at every instant; NIS of the measured ones over rows and instants.

    Also through outages, with thrust, and with random starts (Bar-Shalom, Li & Kirubarajan 2001, section 5.4).
    """
    rows = 8 * ROWS
    env, measurable = FormationVectorEnv(rows, scenario), 6 if scenario.sensor.measures != "position" else 3
    results = [env.reset(seed=1)]
    for actions in 0.3 * random_actions(2, 100, rows):
        infos = results[-1][-1]
        error = infos["estimate"] - infos["true_state"]
        assert_chi2(np.einsum("ri,rij,rj->r", error, np.linalg.inv(covariances(env)), error), 6)
        results.append(env.step(actions))
    nis, measured = collect(results, "nis"), collect(results, "measured")
    assert_chi2(nis[measured], measurable)
    assert (nis[~measured] == 0).all()


def test_uncertainty_grows_in_an_outage_and_recovers_after_it() -> None:
    """The sigmas that the observation shows, and the error they stand for."""
    outage = Windows(windows=(Window(start_s=1500.0, duration_s=3000.0),))
    scenario = dataclasses.replace(load_scenario("keeping"), dropout=outage)
    results = fly_rows(FormationVectorEnv(ROWS, scenario), still(ROWS, 200), seed=0)
    layout = observation_layout(scenario)
    seen = np.array([result[0] for result in results])
    sigma = 10 ** (3 * layout.scalar(seen, "sigma_pos"))[:, 0]
    assert (np.diff(sigma[50:150]) > 0).all()
    assert sigma[149] > 10 * sigma[49]
    assert sigma[150] < 2.1 < sigma[149]
    assert sigma[200] < sigma[49]
    error = collect(results, "estimate")[..., :3] - collect(results, "true_state")[..., :3]
    rms = np.sqrt((error**2).mean(axis=(1, 2)))
    np.testing.assert_allclose(rms, sigma, rtol=0.25)  # ROWS rows: 5 sigma of the root mean square's own error


def test_filter_flies_by_the_model_it_is_given() -> None:
    """Without measurements the estimate is the nominal start, propagated by the filter's model and not the truth's."""
    blind = Windows(windows=(Window(start_s=0.0, duration_s=1e9),))
    scenario = dataclasses.replace(
        noise_free("bx1_companion", blind), filter=KalmanFilter(dynamics="hcw", process_noise_m_s2=1e-3)
    )
    results = fly(FormationEnv(scenario), np.zeros((300, 3), np.float32), seed=0)
    craft = {"orbit": scenario.orbit, "spacecraft": scenario.spacecraft, "leader_spacecraft": scenario.leader}
    times, infos = scenario.dt_s * np.arange(301), [result[-1] for result in results]
    estimate = np.array([info["estimate"] for info in infos])
    truth = np.array([info["true_state"] for info in infos])
    np.testing.assert_allclose(estimate, propagate(np.zeros(6), times, dynamics="hcw", **craft), atol=1e-9)
    np.testing.assert_allclose(truth, propagate(np.zeros(6), times, **craft), rtol=1e-9, atol=1e-6)
    assert np.linalg.norm(truth[-1, :3]) > 100  # differential drag, which HCW does not have


def test_filter_believes_the_noise_it_is_told() -> None:
    """The first update with its own sigmas: P = (1 / P0 + 1 / R)^-1 on each axis."""
    filter_model = KalmanFilter(sigma_pos_m=7.0, sigma_vel_m_s=0.5, initial_sigma_pos_m=3.0, initial_sigma_vel_m_s=0.25)
    scenario = dataclasses.replace(load_scenario("keeping"), filter=filter_model, dropout=NoDropout())
    env = FormationVectorEnv(2, scenario)
    env.reset(seed=0)
    expected = 1 / (np.repeat([3, 0.25], 3) ** -2.0 + np.repeat([7, 0.5], 3) ** -2.0)
    np.testing.assert_allclose(covariances(env), np.tile(np.diag(expected), (2, 1, 1)), rtol=1e-12)


def test_position_sensor_leaves_the_first_velocity_alone() -> None:
    """At the start position and velocity errors are independent, so a position says nothing of the velocity."""
    scenario = dataclasses.replace(load_scenario("keeping"), sensor=Sensor(measures="position"), dropout=NoDropout())
    env = FormationVectorEnv(3, scenario)
    infos = env.reset(seed=0)[1]
    nominal = scenario.start.formation.state(scenario.orbit)
    np.testing.assert_array_equal(infos["estimate"][:, 3:], np.tile(nominal[3:], (3, 1)))
    np.testing.assert_allclose(env.simulation.read("covariance_cross_track")[:, 2], 0.05**2, rtol=1e-12)
    assert (np.abs(infos["estimate"][:, :3] - infos["true_state"][:, :3]) < 10).all()
