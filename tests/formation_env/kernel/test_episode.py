"""Physics, reward and ends of an episode, seen from outside, against equations written out here."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from env_helpers import Array, fly, mean_motion, noise_free, plan, random_actions, restless, steps_of
from scipy.integrate import solve_ivp

from formation_env import FormationEnv, Scenario, Spacecraft, load_scenario, propagate
from formation_env.formations import Following
from formation_env.task.phases import Limits, Phase
from formation_env.task.scenario import Reward

J2, R_EARTH = 1.08263e-3, 6378136.6
COASTING = np.zeros((2000, 3), np.float32)


def truths(results: list[tuple[Any, ...]]) -> Array:
    """True states (instants, 6) of a flight."""
    return np.array([result[-1]["true_state"] for result in results])


def rates(state: Array, accel: Array, scenario: Scenario) -> Array:
    """x' of the modified HCW equations (Ma 2009, eq. 2.66-2.70), with the leader's own drag."""
    n, r = mean_motion(scenario), R_EARTH + scenario.orbit.altitude_m
    i = np.radians(scenario.orbit.inclination_deg)
    c = np.sqrt(1 + 3 * J2 * R_EARTH**2 / (8 * r**2) * (1 + 3 * np.cos(2 * i)))
    k = n * c + 3 * n * J2 * R_EARTH**2 / (2 * r**2) * np.cos(i) ** 2
    follower, leader = (
        craft.air_density_kg_m3 * craft.drag_coefficient * craft.area_m2 / craft.mass_kg
        for craft in (scenario.spacecraft, scenario.leader)
    )
    v1 = n * r
    x, y, z, u, v, w = state
    return np.array(
        [
            u,
            v,
            w,
            2 * n * c * v + (5 * c**2 - 2) * n**2 * x - follower * v1 / 2 * (u - n * y) + accel[0],
            -2 * n * c * u - follower * v1 * (v + n * x) - v1**2 / 2 * (follower - leader) + accel[1],
            -(k**2) * z - follower * v1 / 2 * w + accel[2],
        ]
    )


@pytest.mark.parametrize("name", ["mission", "bx1_companion", "keeping"])
def test_coasting_follows_the_propagation(name: str) -> None:
    """Without noise and thrust the truth is the force-free motion; rounding of 1000 steps of a few km is below 1e-6 m.

    So the estimate is, too, since the filter starts at the truth and has its model.
    """
    scenario = noise_free(name)
    results = fly(
        FormationEnv(scenario), COASTING, seed=0, options={"initial_state": [90.0, -500, 800, 0.3, -0.2, 0.7]}
    )
    times = scenario.dt_s * np.arange(len(results))
    expected = propagate(
        truths(results)[0],
        times,
        orbit=scenario.orbit,
        spacecraft=scenario.spacecraft,
        leader_spacecraft=scenario.leader,
    )
    np.testing.assert_allclose(truths(results), expected, rtol=1e-9, atol=1e-6)
    estimates = [result[-1]["estimate"] for result in results]
    np.testing.assert_allclose(estimates, expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("name", ["mission", "bx1_companion"])
def test_thrust_is_held_over_each_step(name: str) -> None:
    """The truth is the integral of the equations of motion, with the acceleration max_accel * action over each step.

    The integrator's tolerance and rounding stay below 1e-5 m in 40 steps.
    """
    scenario = noise_free(name)
    actions = random_actions(3, 40)
    results = fly(FormationEnv(scenario), actions, seed=0)
    state = truths(results)[0]
    for action, result in zip(actions, results[1:], strict=True):
        accel = scenario.spacecraft.max_accel_m_s2 * action.astype(float)
        np.testing.assert_allclose(result[-1]["accel_m_s2"], accel, rtol=1e-12)
        flight = solve_ivp(
            lambda _, x, a=accel: rates(x, a, scenario), (0, scenario.dt_s), state, "DOP853", rtol=1e-12, atol=1e-9
        )
        state = flight.y[:, -1]
        np.testing.assert_allclose(result[-1]["true_state"], state, rtol=1e-9, atol=1e-5)


def test_actions_are_cut_to_the_limit_of_each_axis() -> None:
    """More than the thruster has is what it has."""
    env = FormationEnv(noise_free("keeping"))
    cut = fly(env, np.array([[5, -0.5, -9]], np.float32), seed=0)[1]
    same = fly(env, np.array([[1, -0.5, -1]], np.float32), seed=0)[1]
    np.testing.assert_array_equal(cut[0], same[0])
    np.testing.assert_allclose(cut[-1]["accel_m_s2"], [0.002, -0.001, -0.002], rtol=1e-12)


@pytest.mark.parametrize(("share", "fires"), [(0.29, False), (0.31, True)])
def test_below_its_minimum_the_thruster_fires_nothing(share: float, fires: bool) -> None:
    """The minimum is of the acceleration's magnitude; what does not fire costs nothing, and the filter knows it."""
    craft = Spacecraft(max_accel_m_s2=0.01, min_accel_m_s2=0.003)
    scenario = dataclasses.replace(noise_free("keeping"), spacecraft=craft)
    action = share * np.array([2, -1, 2]) / 3
    result = fly(FormationEnv(scenario), action[None].astype(np.float32), seed=0)[1]
    np.testing.assert_allclose(result[-1]["accel_m_s2"], fires * 0.01 * action, rtol=1e-6)
    assert result[-1]["delta_v_m_s"] == pytest.approx(fires * share * 0.01 * 30, rel=1e-6)
    np.testing.assert_allclose(result[-1]["estimate"], result[-1]["true_state"], rtol=1e-9, atol=1e-6)


def weighted(name: str, **reward: Any) -> Scenario:
    """A shipped scenario with another reward."""
    return dataclasses.replace(load_scenario(name), reward=Reward(**reward))


REWARDS = {
    "keeping": load_scenario("keeping"),
    "mission": load_scenario("mission"),
    "transfer": weighted("reconfiguration", transfer_error_weight=0.003, error_weight=0.02),
    "quadratic": weighted("mission", error_cost="quadratic", quadratic_scale_m=300.0, transfer_error_weight=0.001),
}


@pytest.mark.parametrize("scenario", REWARDS.values(), ids=REWARDS.keys())
def test_reward_is_minus_delta_v_and_priced_error(scenario: Scenario) -> None:
    """r = -(|u| dt + w e dt / T_hold), e against the reference of the phase that the step belongs to."""
    instants, reward = plan(scenario), scenario.reward
    hold_steps = sum(steps_of(phase.hold_orbits, scenario) for phase in scenario.phases)
    actions = 0.1 * random_actions(4, len(instants) - 1)
    results = fly(FormationEnv(scenario), actions, seed=2)
    assert len(results) == len(instants)
    in_force = [instant.phase for instant in [*instants[2:], instants[-1]]]
    for action, result, instant, phase in zip(actions, results[1:], instants[1:], in_force, strict=True):
        _, value, terminated, _, info = result
        error = np.linalg.norm(info["true_state"][:3] - instant.reference[:3])
        shaped = error if reward.error_cost == "linear" else error**2 / reward.quadratic_scale_m
        weight = reward.error_weight if instant.held else reward.transfer_error_weight
        delta_v = scenario.spacecraft.max_accel_m_s2 * np.linalg.norm(action.astype(float)) * scenario.dt_s
        assert not terminated
        assert info["phase"] == phase
        assert info["position_error_m"] == pytest.approx(error, rel=1e-6, abs=1e-6)
        assert info["delta_v_m_s"] == pytest.approx(delta_v, rel=1e-9)
        assert info["error_cost_m_s"] == pytest.approx(weight * shaped / hold_steps, rel=1e-6, abs=1e-12)
        assert value == pytest.approx(-(delta_v + weight * shaped / hold_steps), rel=1e-6)
    assert [result[3] for result in results[1:]] == [False] * (len(results) - 2) + [True]


FLIGHTS = [
    (load_scenario("mission"), 0.05),
    (load_scenario("initialization"), 0.3),
    (restless(), 1.0),
    (restless(), 3.0),
]


@pytest.mark.parametrize(("scenario", "strength"), FLIGHTS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_totals_are_the_sums_of_what_each_step_told(scenario: Scenario, strength: float, seed: int) -> None:
    """Every metric anew from the infos; after an early end the rest of the hold counts as flown at the limit.

    And the return is an equivalent delta-v: -(delta-v + weight * mean error of the hold), however the episode ends.
    """
    actions = strength * random_actions(seed, scenario.num_steps)
    results = fly(FormationEnv(scenario), actions, seed=seed)
    infos = [result[-1] for result in results]
    totals = infos[-1]["episode_totals"]
    instants = plan(scenario)
    errors = np.array([info["position_error_m"] for info in infos])
    flown = np.array([instant.held for instant in instants])
    held = errors[flown[: len(errors)]]
    stay = max(errors[-1], scenario.limits.max_distance_m)
    missed = np.full(int(flown[len(errors) :].sum()), stay)
    assert (len(missed) > 0) == bool(results[-1][2] and not results[-1][3])
    held = np.concatenate([held, missed])
    arrivals = [
        k for k in range(len(instants)) if not instants[k].held and (k + 1 == len(instants) or instants[k + 1].held)
    ]
    expected = {
        "return": sum(result[1] for result in results[1:]),
        "delta_v_m_s": sum(info["delta_v_m_s"] for info in infos),
        "position_error_mean_m": held.mean(),
        "position_error_rms_m": np.sqrt((held**2).mean()),
        "position_error_max_m": held.max(),
        "position_error_arrival_m": sum(errors[k] if k < len(errors) else stay for k in arrivals) / len(arrivals),
        "position_error_final_m": errors[-1],
        "in_tolerance": (held <= scenario.tolerance_m).mean(),
        "measurements_lost": np.mean([not info["measured"] for info in infos]),
        "steps": len(results) - 1,
    }
    assert totals == pytest.approx(expected, rel=1e-9)
    cost = totals["delta_v_m_s"] + scenario.reward.error_weight * totals["position_error_mean_m"]
    assert totals["return"] == pytest.approx(-cost, rel=1e-9)


@pytest.mark.parametrize("reward", [Reward(), Reward(error_cost="quadratic", transfer_error_weight=0.002)])
def test_leaving_never_pays(reward: Reward) -> None:
    """An early end costs at least what staying at the distance limit, without any thrust, to the end would."""
    scenario = dataclasses.replace(noise_free("reconfiguration"), reward=reward, limits=Limits(max_distance_m=9000.0))
    results = fly(FormationEnv(scenario), np.ones((200, 3), np.float32), seed=0)
    _, value, terminated, truncated, info = results[-1]
    instants = plan(scenario)[len(results) :]
    weights = [reward.error_weight if instant.held else reward.transfer_error_weight for instant in instants]
    shaped = 9000.0 if reward.error_cost == "linear" else 9000.0**2 / reward.quadratic_scale_m
    hold_steps = steps_of(0.35, scenario)
    assert (terminated, truncated) == (True, False)
    assert info["position_error_m"] > 9000 >= results[-2][-1]["position_error_m"]
    assert info["exit_cost_m_s"] >= shaped * sum(weights) / hold_steps > 1
    assert value == -(info["delta_v_m_s"] + info["error_cost_m_s"] + info["exit_cost_m_s"])
    assert all(result[-1]["exit_cost_m_s"] == 0 for result in results[:-1])


def test_the_keep_out_sphere_ends_the_episode() -> None:
    """At the first instant inside it, at the cost of the distance limit; the start lies outside."""
    target = Phase(formation=Following(y0_m=500.0), hold_orbits=1.0)
    scenario = dataclasses.replace(
        noise_free("keeping"), phases=(target,), limits=Limits(keep_out_m=400.0, max_distance_m=5000.0)
    )
    start = dataclasses.replace(scenario.start, formation=Following(y0_m=500.0))
    scenario = dataclasses.replace(scenario, start=start)
    results = fly(FormationEnv(scenario), np.tile(np.float32([0, -1, 0]), (300, 1)), seed=0)
    ranges = np.linalg.norm(truths(results)[:, :3], axis=1)
    assert results[-1][2]
    assert ranges[-1] < 400 <= ranges[:-1].min()
    left = len(plan(scenario)) - len(results)
    expected = scenario.reward.error_weight * 5000 * left / scenario.num_steps
    assert results[-1][-1]["exit_cost_m_s"] == pytest.approx(expected, rel=1e-9)
    with pytest.raises(ValueError, match="initial_state: inside the keep-out sphere of 400 m"):
        FormationEnv(scenario).reset(options={"initial_state": [0, 399, 0, 0, 0, 0]})


def test_an_end_at_the_last_step_costs_nothing_more() -> None:
    """Beyond the limit at the very end: terminated and truncated, with no time left to charge."""
    scenario = noise_free("keeping")
    push = np.tile(np.float32([0, 0.1, 0]), (400, 1))
    results = fly(FormationEnv(scenario), push, seed=0)
    errors = np.array([result[-1]["position_error_m"] for result in results])
    assert errors[-1] > errors[:-1].max()
    limits = Limits(max_distance_m=float(errors[:-1].max() + errors[-1]) / 2)
    last = fly(FormationEnv(dataclasses.replace(scenario, limits=limits)), push, seed=0)[-1]
    assert last[2:4] == (True, True)
    assert last[4]["exit_cost_m_s"] == 0


def test_the_start_can_be_given() -> None:
    """The truth is just there; the first estimate lies about it, and the other rows of info belong to it."""
    start = [10.0, 2000, -300, 0.1, 0.2, -0.3]
    obs, info = FormationEnv("keeping").reset(seed=1, options={"initial_state": start})
    np.testing.assert_array_equal(info["true_state"], start)
    assert np.isfinite(obs).all()
    assert (info["estimate"] != start).all()
    assert (info["delta_v_m_s"], info["phase"]) == (0, 0)
