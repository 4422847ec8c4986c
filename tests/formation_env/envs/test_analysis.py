"""Measurements and noises in the infos of environments made with `analysis=True`."""

import dataclasses

import numpy as np
import pytest
from env_helpers import assert_same, random_actions

from formation_env import FormationEnv, FormationVectorEnv, load_scenario


@pytest.mark.parametrize(
    "name", ["keeping_nonlinear", "keeping_randomized", "thesis_reconfiguration", "bad_communication"]
)
def test_noises_explain_the_flight(name: str) -> None:
    """Measurement errors have the sensor's spread, whatever arrived; a flight replayed from its noises is the flight.

    The replay: the same states from a scenario without randomness are reached by the thrust of the flight plus the
    random acceleration, which acts on the truth just as thrust does.
    """
    scenario = dataclasses.replace(load_scenario(name), domain_randomization=None)
    env, rows = FormationVectorEnv(40, scenario, analysis=True), 40
    plain = FormationVectorEnv(rows, scenario)
    start, first = env.reset(seed=2)
    infos = [first]
    assert_same(plain.reset(seed=2)[0], start)
    assert not infos[0]["process_noise_m_s2"].any()
    for action in random_actions(3, 20, rows):
        result, expected = env.step(0.1 * action), plain.step(0.1 * action)
        assert_same(result[:4], expected[:4])
        infos.append(result[4])
    keys = set(infos[-1]) - set(expected[4])
    assert keys == {
        f"{mask}{key}"
        for mask in ("", "_")
        for key in ("measurement", "innovation", "process_noise_m_s2", "thrust_noise")
    }
    errors = np.array([info["measurement"] - info["true_state"] for info in infos])
    for sigma, part in (
        (scenario.sensor.sigma_pos_m, errors[..., :3]),
        (scenario.sensor.sigma_vel_m_s, errors[..., 3:]),
    ):
        np.testing.assert_allclose(part.std(), sigma, rtol=0.06)
    noises = np.array([info["process_noise_m_s2"] for info in infos[1:]])
    np.testing.assert_allclose(noises.std(), scenario.process_noise_m_s2, rtol=0.06)
    largest = 2 * scenario.spacecraft.max_accel_m_s2 + 10 * scenario.process_noise_m_s2
    quiet = dataclasses.replace(
        scenario,
        process_noise_m_s2=0.0,
        spacecraft=dataclasses.replace(
            scenario.spacecraft, max_accel_m_s2=largest, min_accel_m_s2=0.0, thrust_noise=0.0
        ),
    )
    twin = FormationVectorEnv(rows, quiet)
    twin.reset(seed=2, options={"initial_state": infos[0]["true_state"]})
    for info in infos[1:]:
        replayed = twin.step((info["accel_m_s2"] + info["process_noise_m_s2"]) / largest)[4]
    np.testing.assert_allclose(replayed["true_state"], infos[-1]["true_state"], rtol=1e-6, atol=1e-4)


def test_a_position_sensor_measures_positions() -> None:
    """Its measurement has three elements; the single environment's is the batch's."""
    scenario = load_scenario("keeping")
    sensor = dataclasses.replace(scenario.sensor, measures="position")
    scenario = dataclasses.replace(scenario, sensor=sensor)
    batch, single = FormationVectorEnv(2, scenario, analysis=True), FormationEnv(scenario, analysis=True)
    rows, (_, info) = batch.reset(seed=4)[1], single.reset(seed=4)
    assert rows["measurement"].shape == (2, 3)
    for key in ("measurement", "innovation", "process_noise_m_s2", "thrust_noise"):
        np.testing.assert_array_equal(rows[key][0], info[key])


def test_thrust_noise_is_the_thrusters() -> None:
    """The acceleration that acts is the command times 1 + noise."""
    scenario = load_scenario("keeping")
    craft = dataclasses.replace(scenario.spacecraft, thrust_noise=0.1)
    env = FormationVectorEnv(33, dataclasses.replace(scenario, spacecraft=craft), analysis=True)
    env.reset(seed=0)
    infos = env.step(np.full((33, 3), 0.5))[4]
    expected = 0.5 * craft.max_accel_m_s2 * (1 + infos["thrust_noise"])
    np.testing.assert_allclose(infos["accel_m_s2"], np.repeat(expected[:, None], 3, axis=1), rtol=1e-12)
    assert infos["thrust_noise"].std() > 0.05
