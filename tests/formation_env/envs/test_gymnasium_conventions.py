"""Gymnasium's conventions beyond reset and step: lengths of episodes, autoreset modes, wrappers, and inputs' errors."""

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from env_helpers import assert_same, random_actions, restless
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import TimeAwareObservation, TimeLimit
from gymnasium.wrappers import vector as wrappers

from formation_env import ENV_IDS, FormationEnv, FormationVectorEnv, Scenario, load_scenario

STEPS = 90
ROWS = 5


def singles(scenario: Scenario, mode: AutoresetMode, limit: int | None = None) -> SyncVectorEnv:
    """Gymnasium's batch of single environments, each within a `TimeLimit` if there is one."""

    def make() -> gymnasium.Env[Any, Any]:
        env = FormationEnv(scenario)
        return env if limit is None else TimeLimit(env, limit)

    return SyncVectorEnv([make] * ROWS, autoreset_mode=mode)


def reset_ended(env: VectorEnv[Any, Any, Any], results: tuple[Any, ...]) -> Any:
    """Reset the rows that ended, as a user does where autoreset is disabled."""
    ended = results[2] | results[3]
    return env.reset(options={"reset_mask": ended.copy()}) if ended.any() else None


@pytest.mark.parametrize("limit", [None, 7])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_autoreset_is_gymnasiums(mode: AutoresetMode, limit: int | None) -> None:
    """All that a batch returns equals what SyncVectorEnv of single environments does, in every mode, cut or not."""
    scenario, actions = restless(), np.clip(3 * random_actions(1, STEPS, ROWS), -1, 1)
    batch = FormationVectorEnv(ROWS, scenario, autoreset_mode=mode, max_episode_steps=limit)
    others = singles(scenario, mode, limit)
    assert batch.autoreset_mode is batch.metadata["autoreset_mode"] is mode
    assert_same(batch.reset(seed=5), others.reset(seed=5))
    ends = 0
    for k, action in enumerate(actions):
        ours, theirs = batch.step(action), others.step(action)
        assert_same(ours, theirs, f"step {k}")
        ends += int((ours[2] | ours[3]).sum())
        if mode is AutoresetMode.DISABLED:
            assert_same(reset_ended(batch, ours), reset_ended(others, theirs), f"reset after {k}")
    assert ends > 2 * ROWS


def test_a_row_that_waits_for_its_reset_is_named() -> None:
    """Without autoreset, a step after the end is refused and changes nothing."""
    env = FormationVectorEnv(3, "keeping", autoreset_mode="Disabled", max_episode_steps=1)
    env.reset(seed=0)
    env.step(np.zeros((3, 3)))
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"rows \[0, 1, 2\] have ended.*reset_mask"):
        env.step(np.zeros((3, 3)))
    env.reset()
    env.step(np.zeros((3, 3)))


def test_an_unknown_autoreset_mode_is_named() -> None:
    """The error lists the known ones."""
    with pytest.raises(ValueError, match=r"autoreset_mode: must be one of \['NextStep', 'SameStep', 'Disabled'\], got"):
        FormationVectorEnv(2, autoreset_mode="never")


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(
    "wrap",
    [
        lambda env: wrappers.FlattenObservation(env),
        lambda env: wrappers.TransformObservation(env, lambda obs: obs / 2),
        lambda env: wrappers.RescaleObservation(env, np.float32(-1), np.float32(1)),
        lambda env: wrappers.NormalizeObservation(env),
        lambda env: wrappers.RecordEpisodeStatistics(env),
    ],
)
def test_vector_wrappers_work(wrap: Any, mode: AutoresetMode) -> None:
    """Gymnasium's wrappers of observations take NEXT_STEP and DISABLED (SAME_STEP is refused by Gymnasium itself)."""
    env = FormationVectorEnv(4, restless(), autoreset_mode=mode)
    name = wrap.__code__.co_names[1]
    needs_next_step = name == "NormalizeObservation"
    transforms = name in ("FlattenObservation", "TransformObservation", "RescaleObservation")
    if (needs_next_step and mode is not AutoresetMode.NEXT_STEP) or (transforms and mode is AutoresetMode.SAME_STEP):
        with pytest.raises((AssertionError, ValueError, gymnasium.error.Error)):
            wrap(env)
        return
    wrapped = wrap(env)
    wrapped.reset(seed=0)
    for action in random_actions(0, 30, 4):
        results = wrapped.step(action)
        assert np.isfinite(results[0]).all()
        if mode is AutoresetMode.DISABLED:
            reset_ended(env, results)


@pytest.mark.parametrize("name", ["keeping", "initialization", "thesis_mission"])
def test_the_spec_states_the_length_of_the_plan(name: str) -> None:
    """Also with another scenario than the id's, whose length no `TimeLimit` cuts."""
    scenario = load_scenario(name)
    env = gymnasium.make("FormationKeeping-v0", scenario=name)
    batch = gymnasium.make_vec("FormationKeeping-v0", 2, scenario=name)
    assert env.spec is not None
    assert batch.spec is not None
    assert env.spec.max_episode_steps == batch.spec.max_episode_steps == scenario.num_steps
    assert isinstance(env.unwrapped, FormationEnv)
    again = gymnasium.make(env.spec)
    assert again.spec is not None
    assert again.spec.max_episode_steps == scenario.num_steps


def test_an_episode_of_make_has_the_plans_length() -> None:
    """The longer scenario of the two is flown to its end; TimeAwareObservation knows it."""
    longer, shorter = load_scenario("keeping"), load_scenario(ENV_IDS["FormationInitialization-v0"])
    assert longer.num_steps > shorter.num_steps
    env = TimeAwareObservation(gymnasium.make("FormationInitialization-v0", scenario=longer), normalize_time=True)
    env.reset(seed=0)
    for _ in range(longer.num_steps):
        observation, _, terminated, truncated, info = env.step(np.zeros(3, np.float32))
        if terminated or truncated:
            break
    assert (info["episode_totals"]["steps"], truncated, observation[-1]) == (longer.num_steps, True, 1.0)


def test_make_vec_takes_max_episode_steps() -> None:
    """Rows are truncated there, as `make` truncates a single environment; the spec says so."""
    env = gymnasium.make_vec("FormationKeeping-v0", 2, max_episode_steps=10)
    assert env.spec is not None
    assert env.spec.max_episode_steps == 10
    env.reset(seed=0)
    truncated = np.array([env.step(np.zeros((2, 3)))[3] for _ in range(20)])
    assert (np.flatnonzero(truncated.all(axis=1)) == [9, 19]).all()
    with pytest.raises(ValueError, match="max_episode_steps: must be at least 1, got 0"):
        FormationVectorEnv(2, max_episode_steps=0)


@pytest.mark.parametrize("make", [gymnasium.make, lambda name, **settings: gymnasium.make_vec(name, 2, **settings)])
def test_a_setting_of_the_task_is_sent_to_the_scenario(make: Any) -> None:
    """One line that names the argument and says where it belongs."""
    with pytest.raises(TypeError, match=r"unknown argument 'dt_s'.*scenario=dataclasses\.replace\(.*dt_s=") as error:
        make("FormationKeeping-v0", dt_s=10)
    assert "\n" not in str(error.value)


def test_seeds_may_be_numpys() -> None:
    """Numbers and arrays of numpy seed like Python's."""
    for given in (np.array([1, 2, 3]), (np.int64(1), 2, 3), np.int64(1), np.uint8(1), np.array(1)):
        batch, expected = FormationVectorEnv(3), FormationVectorEnv(3)
        assert_same(batch.reset(seed=given), expected.reset(seed=[1, 2, 3]))
    assert_same(FormationEnv().reset(seed=np.int64(7)), FormationEnv().reset(seed=7))


@pytest.mark.parametrize("bad", [1.5, "1", -1, True, b"1"])
def test_a_bad_seed_is_named(bad: Any) -> None:
    """In both environments, and in a list; the running episode goes on."""
    line = rf"\Aseed: must be an integer >= 0 or None, got {re.escape(repr(bad))}\Z"
    for env, seed in ((FormationEnv(), bad), (FormationVectorEnv(2), bad), (FormationVectorEnv(2), [0, bad])):
        with pytest.raises(ValueError, match=line):
            env.reset(seed=seed)


@pytest.mark.parametrize(
    "bad",
    [
        torch.zeros(3, requires_grad=True),
        torch.zeros(3, dtype=torch.bfloat16),
        [True, 0.5, 0],
        [np.True_, 0.5, 0],
        np.zeros(3, bool),
    ],
)
def test_what_numpy_cannot_read_as_numbers_is_no_action(bad: Any) -> None:
    """Tensors that numpy refuses, and flags among numbers: one line."""
    env, batch = FormationEnv(), FormationVectorEnv(1)
    env.reset(seed=0)
    batch.reset(seed=0)
    with pytest.raises(ValueError, match=r"\Aaction: must be numbers") as error:
        env.step(bad)
    assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"\Aactions: "):
        batch.step([bad] if isinstance(bad, list) else bad[None])


@pytest.mark.parametrize("bad", [["1", "2", "3", "0", "0", "0"], "123456", [True, 0, 0, 0, 0, 0], [[1, 2], [3]]])
def test_a_start_without_numbers_is_named(bad: Any) -> None:
    """Strings that look like numbers are none."""
    for env in (FormationEnv(), FormationVectorEnv(2)):
        with pytest.raises(ValueError, match=r"\Ainitial_state: must be numbers, got"):
            env.reset(seed=0, options={"initial_state": bad})
