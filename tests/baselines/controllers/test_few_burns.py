"""Policies of few burns, and the plain finite-horizon regulator: closed forms, optimality, and how rarely they fire."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from baselines import make_policy
from baselines.design.mid_course_correction import aims, to_arrival
from baselines.design.station_keeping import coasting_sums, error_steps
from baselines.design.transfers import two_impulse
from formation_env import ConfigError, load_scenario
from formation_env.dropout import NoDropout
from formation_env.dynamics import HCW
from formation_env.evaluation.rollout import evaluate
from formation_env.navigation.sensor import Sensor
from formation_env.numerics.arrays import Actions, Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs


class Counting:
    """A policy that counts the thrusts it gives."""

    def __init__(self, policy: Any) -> None:
        self.policy, self.fired, self.asked = policy, 0, 0

    def predict(self, observation: Any, **keywords: Any) -> tuple[Actions, Any]:
        actions, state = self.policy.predict(observation, **keywords)
        self.fired += int((np.abs(actions).max(axis=-1) > 0).sum())
        self.asked += len(actions)
        return actions, state


def quiet(name: str, max_accel_m_s2: float, initial_sigma_pos_m: float = 0.0) -> Scenario:
    """A shipped scenario in HCW's world, without noise and losses; formations without drift stay by themselves."""
    scenario = load_scenario(name)
    return dataclasses.replace(
        scenario,
        dynamics="hcw",
        process_noise_m_s2=0.0,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        dropout=NoDropout(),
        start=dataclasses.replace(scenario.start, initial_sigma_pos_m=initial_sigma_pos_m, initial_sigma_vel_m_s=0.0),
        spacecraft=dataclasses.replace(scenario.spacecraft, max_accel_m_s2=max_accel_m_s2),
    )


def closed_form(scenario: Scenario) -> float:
    """Delta-v of two impulses at start and arrival, m/s."""
    (leg,) = legs(scenario)
    time_s = scenario.dt_s * (leg.arrival - leg.start)
    model = HCW().discretise(0.0, time_s, scenario.orbit, scenario.spacecraft, scenario.leader)
    start = scenario.start.formation.state(scenario.orbit)
    goal = leg_reference(scenario, leg, np.array(leg.arrival))
    return two_impulse(model, time_s, scenario.orbit.mean_motion_rad_s, start, goal).delta_v_m_s


@pytest.mark.parametrize("periods", [0.3, 0.4])
def test_two_impulses_cost_the_closed_form(periods: float) -> None:
    """With thrust for any impulse in one step of 30 s; that is 1.5 % of the transfer, and so is the delta-v off.

    A coast from there on stays within the 30 s that the second burn comes late, at the arrival's speed.
    """
    scenario = quiet("reconfiguration", max_accel_m_s2=1.0)
    phase = dataclasses.replace(scenario.phases[0], transfer_orbits=periods)
    scenario = dataclasses.replace(scenario, phases=(phase,))
    gains = {"correction": {"miss_m": 1.0}, "station_keeping": {"band_m": 1e5}}
    flown = evaluate(make_policy("two_impulse", scenario, gains), scenario, [0])
    assert flown["delta_v_m_s"][0] == pytest.approx(closed_form(scenario), rel=0.015)


def test_weak_thrust_makes_longer_burns_of_them() -> None:
    """At the shipped limit the burns take a tenth of the transfer, and a few percent more delta-v, not less."""
    scenario = quiet("reconfiguration", max_accel_m_s2=0.01)
    counting = Counting(make_policy("two_impulse", scenario))
    flown = evaluate(counting, scenario, [0])
    least = closed_form(scenario)
    assert least < flown["delta_v_m_s"][0] < 1.1 * least
    burn_steps = least / (0.01 * scenario.dt_s)
    assert burn_steps / np.sqrt(3) < counting.fired < 2 * burn_steps


def test_corrections_take_the_miss_away() -> None:
    """An impulse -aim miss, carried to the arrival, moves the place by -miss, wherever it has leverage on it."""
    scenario = load_scenario("reconfiguration")
    (leg,) = legs(scenario)
    Phi, aim = to_arrival(scenario, leg), aims(scenario, leg)
    np.testing.assert_allclose(Phi[:, :3, 3:] @ aim, np.tile(np.eye(3), (len(aim), 1, 1)), atol=1e-9)
    expected = np.linalg.matrix_power(scenario.filter_dynamics().Phi, len(Phi))
    np.testing.assert_allclose(Phi[0], expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


def test_no_impulse_where_it_has_no_leverage() -> None:
    """Half a period before the arrival nothing moves it across the plane (z = z0 cos nt + z0'/n sin nt)."""
    scenario = quiet("initialization", 0.005)
    (leg,) = legs(scenario)
    np.testing.assert_allclose(aims(scenario, leg)[0][2], 0.0, atol=1e-6)


@pytest.mark.parametrize("window", [1, 5, 8, 13])
def test_coasting_sums_are_sums(window: int) -> None:
    """Doubling gives what coasting step by step gives, also where the window reaches beyond the phase's end."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=400.0)
    (leg,) = legs(scenario)
    A = error_steps(scenario, leg)
    error = np.array([30.0, -20.0, 10.0, 0.02, -0.03, 0.01, 1.0])
    for instant in (0, 7, len(A) - 4, len(A)):
        state, total = error, 0.0
        for step in range(instant, min(instant + window, len(A))):
            total += state[:3] @ state[:3]
            state = A[step] @ state
        M = coasting_sums(A, window)[instant]
        assert error @ M @ error == pytest.approx(total, rel=1e-9)


def test_a_deadband_rests_within_its_band() -> None:
    """HCW's own ellipse stays: from the reference nothing fires; from 20 m off it does, and comes within the band."""
    gains = {"station_keeping": {"band_m": 10.0, "look_ahead_orbits": 0.5}}
    still = quiet("keeping", 0.002)
    resting = Counting(make_policy("deadband", still, gains))
    assert evaluate(resting, still, [0])["delta_v_m_s"][0] == 0
    assert resting.fired == 0
    off = quiet("keeping", 0.002, initial_sigma_pos_m=20.0)
    counting = Counting(make_policy("deadband", off, gains))
    flown = evaluate(counting, off, range(16))
    assert 0 < counting.fired < 0.05 * counting.asked
    assert flown["position_error_rms_m"].max() < 2 * 10.0


@pytest.mark.parametrize(("name", "share"), [("deadband", 0.1), ("two_impulse", 0.1)])
def test_few_burns_are_few_and_good_enough(name: str, share: float) -> None:
    """With noise and losses: fewer than a tenth of the steps fire, at under twice the cost of firing at each."""
    counting = Counting(make_policy(name, "keeping"))
    costs = [
        -evaluate(policy, load_scenario("keeping"), range(16))["return"].mean()
        for policy in (counting, make_policy("lqr", "keeping"))
    ]
    assert 0 < counting.fired < share * counting.asked
    assert costs[0] < 2 * costs[1]


def test_lqr_with_a_deadband_fires_less() -> None:
    """Coasting while a thrust saves less than it costs rests in a part of the steps and loses nothing."""
    keeping = load_scenario("keeping")
    design = {"reweighted_lqg": {"floor": 3.76e-4, "error_weight_scale": 0.937}}
    flown = []
    for deadband in (0.0, 1.0):
        counting = Counting(make_policy("lqr", keeping, {**design, "deadband": deadband}))
        cost = -evaluate(counting, keeping, range(32))["return"].mean()
        flown.append((cost, counting.fired / counting.asked))
    assert flown[1][1] < 0.8 * flown[0][1]
    assert flown[1][0] < 1.01 * flown[0][0]


def test_a_deadband_needs_a_cost_with_a_unit() -> None:
    """Weights alone do not say what thrust costs."""
    with pytest.raises(ConfigError, match="deadband: must be 0 with design weights"):
        make_policy("lqr", "keeping", {"design": "weights", "deadband": 1.0})


def least_energy(scenario: Scenario) -> Array:
    """Least sum of squared thrusts from the start to the arrival, as one least-squares problem (steps, 3), m/s^2."""
    (leg,) = legs(scenario)
    count, model = leg.arrival - leg.start, scenario.filter_dynamics()
    to_end = [np.linalg.matrix_power(model.Phi, count - 1 - k) @ model.Gamma for k in range(count)]
    start = scenario.start.formation.state(scenario.orbit)
    gap = leg_reference(scenario, leg, np.array(count)) - np.linalg.matrix_power(model.Phi, count) @ start
    return np.linalg.lstsq(np.hstack(to_end), gap, rcond=None)[0].reshape(count, 3)


def test_the_finite_horizon_takes_least_energy() -> None:
    """With weight on the arrival alone and no noise the delta-v is the least-energy transfer's, plus some holding."""
    scenario = quiet("initialization", max_accel_m_s2=0.1)
    transfer = {"position": [1.0] * 3, "velocity_s2": [1e6] * 3, "control_s2": [1e-6] * 3}
    policy = make_policy("lqr_finite", scenario, {"transfer": transfer})
    flown = evaluate(policy, scenario, [0])
    expected = scenario.dt_s * np.linalg.norm(least_energy(scenario), axis=1).sum()
    assert flown["delta_v_m_s"][0] == pytest.approx(expected, rel=0.01)
    assert flown["position_error_arrival_m"][0] < 1.0
