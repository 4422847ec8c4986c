"""The batched environment is many single ones, bit for bit."""

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from env_helpers import assert_same, fly, fly_rows, random_actions, restless, row_of, spoil
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from formation_env import FormationEnv, FormationVectorEnv, Scenario, load_scenario
from formation_env.dropout import Bernoulli
from formation_env.task.observation import observation_layout
from formation_env.task.phases import Limits

STEPS = 90


def sync(num_envs: int, scenario: Scenario) -> SyncVectorEnv:
    """Gymnasium's batch of single environments, with the same autoreset."""
    makers = [lambda: FormationEnv(scenario)] * num_envs
    return SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)


def keep_out() -> Scenario:
    """Followers that start near a sphere they must not enter, so that some do."""
    scenario = load_scenario("keeping")
    start = dataclasses.replace(scenario.start, initial_sigma_pos_m=100.0, initial_sigma_vel_m_s=0.5)
    return dataclasses.replace(scenario, start=start, dropout=Bernoulli(), limits=Limits(keep_out_m=3850.0))


@pytest.mark.parametrize("scenario", [restless(), keep_out(), load_scenario("initialization")])
@pytest.mark.parametrize("num_envs", [1, 33])
def test_equals_gymnasiums_batch_of_single_envs(scenario: Scenario, num_envs: int) -> None:
    """Observations, rewards, ends, infos, final infos, masks and their types, over episodes of different lengths."""
    actions = np.clip(3 * random_actions(1, STEPS, num_envs), -1, 1)
    batch, singles = FormationVectorEnv(num_envs, scenario), sync(num_envs, scenario)
    assert_same(batch.reset(seed=5), singles.reset(seed=5))
    for k, action in enumerate(actions):
        assert_same(batch.step(action), singles.step(action), f"step {k}")
    assert_same(batch.reset(), singles.reset())
    assert_same(batch.step(actions[0]), singles.step(actions[0]))


def test_the_comparison_sees_many_different_ends() -> None:
    """What the test above compares: rows that end at many steps, of both kinds, several times each."""
    results = fly_rows(FormationVectorEnv(33, restless()), np.clip(3 * random_actions(1, STEPS, 33), -1, 1), seed=5)
    terminated, truncated = np.array([r[2] for r in results[1:]]), np.array([r[3] for r in results[1:]])
    assert len(np.flatnonzero(terminated.any(axis=1))) > 20
    assert truncated.sum() > 20
    assert (terminated | truncated).sum(axis=0).min() >= 2


@pytest.mark.parametrize("num_envs", [1, 31, 32, 33, 70])
def test_each_row_is_a_single_env_whatever_the_neighbours_do(num_envs: int) -> None:
    """Row i of seed s equals a single environment of seed s + i; around it others end, act otherwise or are missing."""
    scenario = restless()
    actions = random_actions(2, STEPS, num_envs)
    batch = FormationVectorEnv(num_envs, scenario)
    results = fly_rows(batch, actions, seed=100)
    for row in {0, num_envs // 2, num_envs - 1}:
        single = fly(FormationEnv(scenario), actions[:, row], seed=100 + row)
        for k, (one, many) in enumerate(zip(single[:-1], results, strict=False)):
            *arrays, info = row_of(many, row)
            np.testing.assert_array_equal(one[0], arrays[0], err_msg=f"step {k}")
            assert [float(x) for x in one[1:-1]] == [float(x) for x in arrays[1:]]
            for key, value in one[-1].items():
                np.testing.assert_array_equal(value, info[key], err_msg=f"step {k}: {key}")


def test_seeds_may_be_a_list() -> None:
    """One per row, in any order; a row without a seed goes on with its own stream."""
    scenario = load_scenario("keeping")
    env = FormationVectorEnv(3, scenario)
    observations, _ = env.reset(seed=[7, 3, 7])
    expected = [FormationEnv(scenario).reset(seed=seed)[0] for seed in (7, 3)]
    np.testing.assert_array_equal(observations, [expected[0], expected[1], expected[0]])
    single = FormationEnv(scenario)
    single.reset(seed=3)
    observations, _ = env.reset(seed=[None, None, 3])
    np.testing.assert_array_equal(observations[1:], [single.reset()[0], expected[1]])
    with pytest.raises(ValueError, match="seed: a list must have 3 elements, got 2"):
        env.reset(seed=[1, 2])


def test_reset_mask_leaves_the_others_alone() -> None:
    """The rows of the mask begin an episode; the others' results and flights are untouched."""
    scenario = load_scenario("keeping")
    env, untouched = FormationVectorEnv(40, scenario), FormationVectorEnv(40, scenario)
    mask = np.arange(40) % 3 == 0
    for each in (env, untouched):
        fly_rows(each, random_actions(3, 5, 40), seed=2)
    _, infos = env.reset(options={"reset_mask": mask})
    action = random_actions(4, 40)
    after, plain = env.step(action), untouched.step(action)
    np.testing.assert_array_equal(after[0][~mask], plain[0][~mask])
    np.testing.assert_array_equal(after[4]["true_state"][~mask], plain[4]["true_state"][~mask])
    assert (after[0][mask] != plain[0][mask]).any(axis=1).all()
    distance = np.linalg.norm(
        infos["true_state"][mask, :3] - scenario.start.formation.state(scenario.orbit)[:3], axis=1
    )
    assert (distance < 5 * np.sqrt(3) * scenario.start.initial_sigma_pos_m).all()


def test_reset_mask_equals_gymnasiums() -> None:
    """With seeds for some rows, and steps after it."""
    scenario = load_scenario("keeping")
    env, singles = FormationVectorEnv(5, scenario), sync(5, scenario)
    mask = np.array([True, False, True, False, True])
    for each in (env, singles):
        fly_rows(each, random_actions(3, 5, 5), seed=2)
    seeds = [9, 9, None, None, 4]
    ours = env.reset(seed=seeds, options={"reset_mask": mask})
    assert_same(ours, singles.reset(seed=seeds, options={"reset_mask": mask}))
    for action in random_actions(6, 10, 5):
        assert_same(env.step(action), singles.step(action))


def test_outputs_share_no_memory_with_the_inside() -> None:
    """Whoever writes into what was returned changes nothing, not even what a masked reset returns of the others."""
    env, untouched = FormationVectorEnv(40, restless()), FormationVectorEnv(40, restless())
    untouched.reset(seed=5)
    spoil(env.reset(seed=5))
    for action in random_actions(1, STEPS, 40):
        result = env.step(action)
        assert_same(result, untouched.step(action))
        spoil(result)
    options = {"reset_mask": np.arange(40) % 2 == 0}
    assert_same(env.reset(options=dict(options)), untouched.reset(options=dict(options)))


@pytest.mark.parametrize("mask", [np.ones(2, bool), np.ones(3), [1, 0, 1]])
def test_a_wrong_reset_mask_is_refused(mask: Any) -> None:
    """Wrong length, or not of flags."""
    env = FormationVectorEnv(3)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"reset_mask: must be bool \(3,\)"):
        env.reset(options={"reset_mask": mask})


def test_initial_states_may_be_given_for_each_row() -> None:
    """The truth is there exactly; the estimate about it."""
    scenario = load_scenario("keeping")
    starts = np.random.default_rng(0).normal(scale=[1000] * 3 + [1] * 3, size=(35, 6))
    env = FormationVectorEnv(35, scenario)
    _, infos = env.reset(seed=1, options={"initial_state": starts})
    np.testing.assert_array_equal(infos["true_state"], starts)
    _, info = FormationEnv(scenario).reset(seed=1 + 33, options={"initial_state": starts[33]})
    np.testing.assert_array_equal(infos["estimate"][33], info["estimate"])
    _, infos = env.reset(options={"initial_state": starts[0]})
    np.testing.assert_array_equal(infos["true_state"], np.tile(starts[0], (35, 1)))


def test_final_observation_is_that_of_the_ended_episode() -> None:
    """A row that ends returns the first observation of its next episode, and the last of this one apart."""
    scenario = load_scenario("initialization")
    env = FormationVectorEnv(3, scenario)
    results = fly_rows(env, np.zeros((scenario.num_steps, 3, 3), np.float32), seed=0)
    observations, _, terminated, truncated, infos = results[-1]
    assert truncated.all()
    assert not terminated.any()
    layout = observation_layout(scenario)
    assert (layout.scalar(np.stack(infos["final_obs"]), "time_left") == 0).all()
    assert (layout.scalar(observations, "time_left") > 0.7).all()
    assert (infos["final_info"]["episode_totals"]["steps"] == scenario.num_steps).all()


def digest() -> str:
    """A fingerprint of a batch's flight."""
    env = FormationVectorEnv(45, restless())
    results = fly_rows(env, random_actions(8, STEPS, 45), seed=77)
    fingerprint = hashlib.sha256()
    for observations, *_, infos in results:
        fingerprint.update(observations.tobytes() + infos["true_state"].tobytes() + infos["estimate"].tobytes())
    return fingerprint.hexdigest()


def test_equal_seeds_give_equal_rollouts_in_another_process() -> None:
    """Nothing depends on the process: not on hashes, on addresses, or on what ran before."""
    FormationVectorEnv(3).reset(seed=1)
    code = "import test_vector; print(test_vector.digest())"
    here = Path(__file__).parent
    paths = {"PYTHONPATH": os.pathsep.join([str(here), *sys.path])}
    run = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | paths, capture_output=True, text=True, check=True, timeout=120
    )
    assert run.stdout.strip() == digest()


def test_wrong_numbers_of_rows_are_refused() -> None:
    """At least one, and no rendering."""
    with pytest.raises(ValueError, match="num_envs: must be at least 1, got 0"):
        FormationVectorEnv(0)
    with pytest.raises(ValueError, match="render_mode: the batched environment has none"):
        FormationVectorEnv(2, render_mode="rgb_array")
