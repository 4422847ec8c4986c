"""Cost of an error, and which step scores it with which weight, against a construction step by step."""

import dataclasses

import numpy as np
import pytest

from formation_env import FormationEnv, load_scenario
from formation_env.task.reward import ErrorCost, Reward, scoring
from formation_env.task.schedule import legs, score_table

PHASES = [(3, 7), (7, 9), (11, 16)]
"""Arrivals and ends of three phases, the second without a transfer."""


def test_errors_are_scored_by_the_phase_of_the_step_that_ends_there() -> None:
    """Steps are counted phase by phase: transfer, then hold; each scores the instant at its end."""
    reward, dt_s = Reward(error_weight=0.02, transfer_error_weight=0.003), 30.0
    leg, in_hold, start = [0], [False], 0
    for index, (arrival, end) in enumerate(PHASES):
        for step in range(start, end):
            leg.append(index)
            in_hold.append(step >= arrival)
        start = end
    scores = scoring(reward, [arrival for arrival, _ in PHASES], [end for _, end in PHASES], dt_s)
    np.testing.assert_array_equal(scores.leg, leg)
    np.testing.assert_array_equal(scores.in_hold, in_hold)
    weight = np.where(in_hold, 0.02, 0.003) / sum(in_hold)
    weight[0] = 0
    np.testing.assert_allclose(scores.error_weight, weight, rtol=1e-14)


@pytest.mark.parametrize("name", ["keeping", "mission", "initialization"])
def test_the_holds_weights_add_up_to_the_error_weight(name: str) -> None:
    """So that the reward counts the hold's mean error, and the environment's hold time is that of the table."""
    scenario = load_scenario(name)
    scores = score_table(scenario)
    assert scores.error_weight.sum() == pytest.approx(scenario.reward.error_weight, rel=1e-12)
    assert scores.in_hold.sum() * scenario.dt_s == pytest.approx(scenario.hold_s, rel=1e-12)
    assert len(scores.leg) == scenario.num_steps + 1 == legs(scenario)[-1].end + 1


def test_cost_of_an_error() -> None:
    """|e|, or |e|^2 over the scale, at which both cost the same; the equivalent square costs what the error does."""
    error = np.array([0.0, 1.0, 50.0, 200.0])
    linear, quadratic = Reward().cost(), Reward(error_cost="quadratic", quadratic_scale_m=50.0).cost()
    np.testing.assert_array_equal(linear.of(error), error)
    np.testing.assert_allclose(quadratic.of(error), [0, 0.02, 50, 800], rtol=1e-14)
    assert linear.of(error)[2] == pytest.approx(quadratic.of(error)[2])
    for cost in (linear, quadratic, ErrorCost(linear=0.5, quadratic=0.1)):
        np.testing.assert_allclose(cost.per_square(error[1:], 0.0) * error[1:] ** 2, cost.of(error[1:]), rtol=1e-14)
    assert np.isfinite(linear.per_square(error, 0.01)).all()


def test_only_a_straight_cost_has_a_weight_of_the_mean_error() -> None:
    """Quadratic costs and costs of the transfer are of another form."""
    assert Reward(error_weight=0.02).mean_error_weight() == 0.02
    assert Reward(error_cost="quadratic").mean_error_weight() is None
    assert Reward(transfer_error_weight=0.001).mean_error_weight() is None


def test_the_environment_pays_what_the_table_says() -> None:
    """Coasting through both transfers and holds of a mission: each reward is minus weight times error at its end."""
    scenario = load_scenario("mission")
    reward = Reward(error_weight=0.02, transfer_error_weight=0.003, error_cost="quadratic", quadratic_scale_m=70.0)
    limits = dataclasses.replace(scenario.limits, max_distance_m=1e9)
    scenario = dataclasses.replace(scenario, reward=reward, limits=limits, dt_s=120.0)
    env, scores = FormationEnv(scenario), score_table(scenario)
    env.reset(seed=0)
    for step in range(scenario.num_steps):
        _, paid, _, _, info = env.step(np.zeros(3, np.float32))
        expected = scores.error_weight[step + 1] * info["position_error_m"] ** 2 / 70
        assert paid == pytest.approx(-expected, rel=1e-6)
