"""Environments of several followers: their faces agree with one another and with the environment of one follower."""

import warnings
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from formation_env import (
    SWARM_IDS,
    ConfigError,
    FormationEnv,
    FormationSwarmEnv,
    FormationSwarmVectorEnv,
    Scenario,
    load_scenario,
    parallel_env,
)
from formation_env.task.followers import Safety

pettingzoo_test = pytest.importorskip("pettingzoo.test")


def short(name: str, **changes: Any) -> Scenario:
    """A shipped scenario whose phases are a tenth as long, with the thrust for it."""
    scenario = load_scenario(name)
    phases = tuple(
        replace(phase, transfer_orbits=phase.transfer_orbits / 10, hold_orbits=phase.hold_orbits / 10)
        for phase in scenario.phases
    )
    spacecraft = replace(scenario.spacecraft, max_accel_m_s2=1.0)
    return replace(scenario, phases=phases, spacecraft=spacecraft, **changes)


@pytest.mark.parametrize("env_id", SWARM_IDS)
def test_gymnasium_accepts_the_joint_face(env_id: str) -> None:
    """Gymnasium's own checker, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(env_id).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", ["swarm", "swap"])
def test_pettingzoo_accepts_the_parallel_face(name: str) -> None:
    """PettingZoo's own tests, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pettingzoo_test.parallel_api_test(parallel_env(short(name)), num_cycles=40)
        pettingzoo_test.parallel_seed_test(lambda: parallel_env(short(name)))


def test_a_group_of_one_is_the_single_environment() -> None:
    """Bit for bit, in truth, reward and infos."""
    scenario = replace(load_scenario("initialization"), safety=Safety(min_distance_m=50.0))
    group, single = FormationSwarmEnv(scenario), FormationEnv(scenario)
    (group_obs, _), (obs, _) = group.reset(seed=5), single.reset(seed=5)
    actions, ended = np.random.default_rng(0), False
    while not ended:
        np.testing.assert_array_equal(group_obs[0], obs)
        action = actions.uniform(-1, 1, 3).astype(np.float32)
        group_obs, group_reward, group_ended, group_cut, group_info = group.step(action[None])
        obs, reward, terminated, truncated, info = single.step(action)
        assert (group_reward, group_ended, group_cut) == (reward, terminated, truncated)
        for name in ("true_state", "estimate", "cost", "least_distance_m", "nis"):
            np.testing.assert_array_equal(group_info[name][0], info[name])
        ended = terminated or truncated
    for name, value in info["episode_totals"].items():
        assert group_info["episode_totals"][name][0] == value
    assert info["episode_totals"]["cost"] > 0  # it begins at the leader


@pytest.mark.parametrize("name", ["swap", "swarm_nonlinear"])
def test_groups_of_a_batch_are_those_alone(name: str) -> None:
    """Bit for bit, over the end of an episode and in any number of threads."""
    scenario, groups = short(name), 70
    batch = FormationSwarmVectorEnv(groups, scenario, num_threads=2)
    observations, infos = batch.reset(seed=3)
    alone = {group: FormationSwarmEnv(scenario) for group in (0, 63, 64, 69)}
    for group, env in alone.items():
        first, info = env.reset(seed=3 + group)
        np.testing.assert_array_equal(observations[group], first)
        np.testing.assert_array_equal(infos["slots"][group], info["slots"])
    generator = np.random.default_rng(1)
    for _ in range(scenario.num_steps + 3):
        actions = generator.uniform(-1, 1, batch.action_space.shape).astype(np.float32)  # type: ignore[arg-type]
        observations, rewards, terminations, truncations, infos = batch.step(actions)
        for group, env in alone.items():
            obs, reward, terminated, truncated, info = env.step(actions[group])
            assert (rewards[group], terminations[group], truncations[group]) == (reward, terminated, truncated)
            if terminated or truncated:
                np.testing.assert_array_equal(infos["final_obs"][group], obs)
                np.testing.assert_array_equal(infos["final_info"]["true_state"][group], info["true_state"])
                totals = infos["final_info"]["episode_totals"]
                np.testing.assert_array_equal(totals["cost"][group], info["episode_totals"]["cost"])
                obs, info = env.reset()
            np.testing.assert_array_equal(observations[group], obs)
            np.testing.assert_array_equal(infos["true_state"][group], info["true_state"])


def test_parallel_and_joint_face_agree() -> None:
    """An agent's observation, reward and cost are those of its line."""
    scenario = short("swap")
    joint, parallel = FormationSwarmEnv(scenario), parallel_env(scenario)
    (lines, _), (by_agent, _) = joint.reset(seed=2), parallel.reset(seed=2)
    np.testing.assert_array_equal(np.stack([by_agent[name] for name in parallel.agents]), lines)
    actions = np.random.default_rng(0).uniform(-1, 1, (8, 3)).astype(np.float32)
    lines, reward, _, _, info = joint.step(actions)
    by_agent, rewards, _, _, infos = parallel.step(dict(zip(parallel.agents, actions, strict=True)))
    np.testing.assert_array_equal(np.stack([by_agent[name] for name in parallel.agents]), lines)
    assert np.mean(list(rewards.values())) == pytest.approx(reward, rel=1e-12)
    assert [infos[name]["cost"] for name in parallel.agents] == info["cost"].tolist()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_other_ways_to_reset(mode: AutoresetMode) -> None:
    """NEXT_STEP begins by the next step, DISABLED by the user."""
    scenario = short("swarm")
    env = FormationSwarmVectorEnv(2, scenario, autoreset_mode=mode)
    env.reset(seed=0)
    actions = np.zeros(env.action_space.shape, np.float32)  # type: ignore[arg-type]
    for _ in range(scenario.num_steps):
        last, _, _, truncations, infos = env.step(actions)
    assert truncations.all()
    assert "episode_totals" in infos
    if mode is AutoresetMode.NEXT_STEP:
        _, rewards, _, truncations, _ = env.step(actions)
        assert not truncations.any()
        assert not rewards.any()
    else:
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(actions)
        observations, _ = env.reset(options={"reset_mask": np.array([True, False])})
        np.testing.assert_array_equal(observations[1], last[1])
        assert (observations[0] != last[0]).any()


def test_slots_and_starts_are_taken() -> None:
    """Options of reset: who flies where, and from which states."""
    env = FormationSwarmEnv("swap")
    slots = np.roll(np.arange(8), 3)
    _, info = env.reset(seed=0, options={"slots": slots})
    np.testing.assert_array_equal(info["slots"], slots)
    starts = info["true_state"]
    _, info = env.reset(seed=1, options={"slots": slots, "initial_state": starts})
    np.testing.assert_array_equal(info["true_state"], starts)
    for wrong in ([0] * 8, slots[:3], slots + 1):
        with pytest.raises(ValueError, match="slots: "):
            env.reset(options={"slots": wrong})


def test_several_followers_are_refused_where_one_flies() -> None:
    """The message names the environment that takes them."""
    with pytest.raises(ConfigError, match="followers: 8, but this environment flies one; FormationSwarmEnv flies"):
        FormationEnv("swap")
