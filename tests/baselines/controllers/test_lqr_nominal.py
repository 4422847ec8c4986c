"""LQR about one plan: undisturbed it flies the plan, which is the bound; disturbed it beats phases designed alone."""

import dataclasses

import numpy as np
import pytest

from baselines import fuel_optimal, make_policy
from baselines.controllers.lqr_nominal import mission_plan
from formation_env import load_scenario
from formation_env.dropout import NoDropout
from formation_env.evaluation.rollout import evaluate
from formation_env.navigation.sensor import Sensor
from formation_env.task.scenario import Scenario


def quiet(scenario: Scenario) -> Scenario:
    """Without noise and losses, from the nominal start."""
    return dataclasses.replace(
        scenario,
        process_noise_m_s2=0.0,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        dropout=NoDropout(),
        start=dataclasses.replace(scenario.start, initial_sigma_pos_m=0.0, initial_sigma_vel_m_s=0.0),
    )


@pytest.mark.parametrize("name", ["initialization", "mission"])
def test_undisturbed_it_costs_what_is_least(name: str) -> None:
    """The environment, flown without noise, returns the certified least cost.

    Single-precision observations of kilometres tell the position to a tenth of a millimetre: 1e-3 of the cost.
    """
    scenario = quiet(dataclasses.replace(load_scenario(name), dt_s=60.0))
    cost = -evaluate(make_policy("lqr_nominal", scenario), scenario, [0])["return"][0]
    least = fuel_optimal(scenario).cost
    assert least * (1 - 1e-6) <= cost <= least * (1 + 1e-3)


def test_a_plan_through_all_phases_beats_phases_planned_alone() -> None:
    """Mission with all its noise: a sixth less than `lqr`, on the same seeds, every one of them."""
    scenario = dataclasses.replace(load_scenario("mission"), dt_s=60.0)
    planned, alone = (
        -evaluate(make_policy(policy, scenario), scenario, range(12))["return"].to_numpy()
        for policy in ("lqr_nominal", "lqr")
    )
    assert (planned < 0.9 * alone).all()


def test_the_plan_is_by_what_the_filter_believes() -> None:
    """A nonlinear truth with perturbations: the plan is that of the linear model in its place."""
    real = load_scenario("keeping_nonlinear")
    filter_model = real.filter_model
    linear = dataclasses.replace(
        real, dynamics=filter_model.dynamics, orbit=filter_model.orbit, perturbations=type(real.perturbations)()
    )
    np.testing.assert_array_equal(mission_plan(real).states, mission_plan(linear).states)
