"""The contract that every registered environment and every shipped scenario keeps."""

import copy
import dataclasses
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from env_helpers import assert_same, fly, fly_rows, random_actions, spoil
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from formation_env import ENV_IDS, FormationEnv, FormationVectorEnv, Scenario, load_scenario, scenario_names
from formation_env.dropout import Window, Windows
from formation_env.task.loading import config_folder
from formation_env.task.observation import BLOCKS, BOUND, SIZE

NAMES = scenario_names()
COARSE = [name for name in NAMES if not name.startswith("thesis")]
STEPS = 60
"""Enough to see every stage at work; the thesis's episodes have up to 58 000."""


@pytest.fixture(scope="module", params=[*ENV_IDS, *NAMES])
def env(request: pytest.FixtureRequest) -> Any:
    """An environment of each id and each scenario."""
    made = gymnasium.make(request.param).unwrapped if request.param in ENV_IDS else FormationEnv(request.param)
    yield made
    made.close()


def test_checkers_of_gymnasium_and_sb3_pass_without_warning(env: FormationEnv) -> None:
    """Both state what a Gymnasium environment is."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True)
        check_env_sb3(env, warn=True, skip_render_check=True)


def test_spaces_are_those_of_the_documentation(env: FormationEnv) -> None:
    """Box(-1, 1, (3,)) and a bounded box of as many elements as the table has, both float32."""
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (3,), np.float32)
    assert env.observation_space == gymnasium.spaces.Box(-BOUND, BOUND, (sum(b.size for b in BLOCKS),), np.float32)


def test_equal_seeds_give_equal_rollouts(env: FormationEnv) -> None:
    """Everything that comes out, bit for bit; another seed gives another flight wherever anything is random."""
    actions = random_actions(0, STEPS)
    first = fly(env, actions, seed=11)
    assert_same(fly(env, actions, seed=11), first)
    scenario = env.scenario
    is_random = scenario.start.initial_sigma_pos_m > 0 or scenario.sensor.sigma_pos_m > 0
    assert is_random == (scenario != load_scenario("thesis_initialization"))
    assert np.any(fly(env, actions, seed=12)[-1][-1]["true_state"] != first[-1][-1]["true_state"]) == is_random


def test_two_resets_differ(env: FormationEnv) -> None:
    """Without a seed the stream goes on: the second episode is another one, and again the same one for that seed."""
    first, second = env.reset(seed=3), env.reset()
    is_random = env.scenario.start.initial_sigma_pos_m > 0
    assert np.any(first[1]["true_state"] != second[1]["true_state"]) == is_random
    env.reset(seed=3)
    assert_same(env.reset(), second)


def test_outputs_share_no_memory_with_the_inside(env: FormationEnv) -> None:
    """Whoever writes into what was returned changes nothing of the flight."""
    actions = random_actions(1, STEPS)
    expected = fly(env, actions, seed=5)
    spoil(env.reset(seed=5))
    for action, (obs, reward, *_) in zip(actions, expected[1:], strict=True):
        given = action.copy()
        result = env.step(given)
        np.testing.assert_array_equal(result[0], obs)
        assert result[1] == reward
        given[:] = np.nan
        spoil(result)


@pytest.mark.parametrize("name", ["mission", "thesis_reconfiguration"])
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_continue_identically(name: str, duplicate: Callable[[FormationEnv], FormationEnv]) -> None:
    """A copy in mid-flight flies on as the original does, and neither moves the other; resets go on alike, too."""
    for env, rows in ((FormationEnv(name), ()), (FormationVectorEnv(3, name), (3,))):
        actions = random_actions(2, STEPS, *rows)
        env.reset(seed=8)
        env.step(actions[0])
        twin = duplicate(env)
        expected = [*(twin.step(action) for action in actions), twin.reset()]
        assert_same([*(env.step(action) for action in actions), env.reset()], expected)


def everything(name: str) -> tuple[FormationVectorEnv, list[tuple[Any, ...]]]:
    """Rows that do nothing, act at random and push into all eight corners, over an episode or its first part."""
    corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    env = FormationVectorEnv(2 + len(corners), name)
    steps = min(env.scenario.num_steps, 1000)
    noise = random_actions(4, steps)
    actions = np.stack([np.vstack([np.zeros(3), noise[k], corners]) for k in range(steps)]).astype(np.float32)
    return env, fly_rows(env, actions, seed=21)


@pytest.fixture(scope="module")
def extremes() -> dict[str, tuple[FormationVectorEnv, list[tuple[Any, ...]]]]:
    """The flights of `everything` for each scenario."""
    return {name: everything(name) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_outputs_are_finite_and_within_bounds(name: str, extremes: dict[str, Any]) -> None:
    """Whatever the actions; also what an episode ends with, far outside the plan."""
    env, results = extremes[name]
    for observations, rewards, *_, infos in results[1:]:
        assert env.observation_space.contains(observations)
        assert np.isfinite(rewards).all()
        assert (rewards <= 0).all()
        assert all(np.isfinite(infos[key]).all() for key in infos if not key.startswith(("_", "final")))
        for row in np.flatnonzero(infos.get("_final_obs", [])):
            assert env.single_observation_space.contains(infos["final_obs"][row])
            assert all(np.isfinite(v[row]) for k, v in infos["final_info"]["episode_totals"].items() if k[0] != "_")


def test_no_element_of_the_observation_is_constant(extremes: dict[str, Any]) -> None:
    """Each of them says something in some environment, and is of order one."""
    seen = np.concatenate([obs[:2] for _, results in extremes.values() for obs, *_ in results])
    assert seen.shape[1] == SIZE
    assert (np.ptp(seen, axis=0) > 0.1).all()
    assert (np.abs(seen).mean(axis=0) < 5).all()


@pytest.mark.parametrize("name", COARSE)
def test_observation_never_holds_the_truth(name: str) -> None:
    """Without any measurement, two followers that truly start and fly differently in one scenario look the same."""
    lost = Windows(windows=(Window(start_s=0.0, duration_s=1e9),))
    env = FormationEnv(dataclasses.replace(load_scenario(name), dropout=lost, domain_randomization=None))
    one, other = (fly(env, random_actions(5, STEPS), seed=seed) for seed in (1, 2))
    assert np.all(one[0][1]["true_state"] != other[0][1]["true_state"])
    assert np.all(one[-1][4]["true_state"] != other[-1][4]["true_state"])
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a[0], b[0])


def test_scenario_may_be_a_name_a_path_or_an_object() -> None:
    """The keyword works alike on every way to an environment."""
    path = config_folder("scenarios") / "mission.yaml"
    expected = load_scenario("mission")
    ways: list[str | Path | Scenario] = ["mission", path, str(path), expected]
    for way in ways:
        assert gymnasium.make("FormationKeeping-v0", scenario=way).unwrapped.scenario == expected
        assert FormationVectorEnv(2, way).scenario == expected
        batch = gymnasium.make_vec("FormationKeeping-v0", 2, "vector_entry_point", scenario=way)
        assert batch.unwrapped.scenario == expected


@pytest.mark.parametrize(("env_id", "scenario"), ENV_IDS.items())
def test_both_faces_are_registered(env_id: str, scenario: str) -> None:
    """`make` gives the single environment, `make_vec` the batched one, each with its scenario."""
    single = gymnasium.make(env_id).unwrapped
    batch = gymnasium.make_vec(env_id, 3, vectorization_mode="vector_entry_point").unwrapped
    assert isinstance(single, FormationEnv)
    assert isinstance(batch, FormationVectorEnv)
    assert single.scenario == batch.scenario == load_scenario(scenario)
    assert batch.num_envs == 3


def test_make_finds_the_module_by_itself(tmp_path: Path) -> None:
    """`formation_env:ID` needs no import, in a process that has none, with any warning an error."""
    code = (
        "import gymnasium, sys; assert 'formation_env' not in sys.modules;"
        "env = gymnasium.make('formation_env:FormationKeeping-v0'); env.reset(seed=0);"
        "env.step(env.action_space.sample()); env.close()"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=tmp_path, check=True, timeout=120)


NAN, INF = float("nan"), float("inf")
BAD_ACTIONS: list[Any] = [
    [0, NAN, 0],
    [INF, 0, 0],
    [INF, -INF, 0],
    [1e300, 0, 0],
    [0, 0],
    [[0, 0, 0]],
    0.0,
    None,
    "forward",
    ["0", "1", "0"],
    [0, [0, 1], 0],
    {"thrust": 1},
    [1j, 0, 0],
]


@pytest.mark.parametrize("bad", BAD_ACTIONS, ids=str)
def test_a_bad_action_is_named_and_changes_nothing(bad: Any) -> None:
    """The flight goes on as if it had not been tried."""
    env, untouched = FormationEnv("keeping"), FormationEnv("keeping")
    assert_same(env.reset(seed=4), untouched.reset(seed=4))
    for action in random_actions(6, 2):
        with pytest.raises(ValueError, match=r"^action: must be"):
            env.step(bad)
        assert_same(env.step(action), untouched.step(action))


@pytest.mark.parametrize("bad", BAD_ACTIONS, ids=str)
def test_bad_actions_of_a_batch_are_named_and_change_nothing(bad: Any) -> None:
    """One row is wrong, the others are not; none of them moves. A row that is not finite is named."""
    env, untouched = FormationVectorEnv(3, "keeping"), FormationVectorEnv(3, "keeping")
    assert_same(env.reset(seed=4), untouched.reset(seed=4))
    where = r"^actions: row 1 must be finite" if bad in BAD_ACTIONS[:4] else r"^actions: "
    with pytest.raises(ValueError, match=where):
        env.step([[0, 0, 0], bad, [0, 0, 0]])
    with pytest.raises(ValueError, match=r"^actions: "):
        env.step(bad)
    assert_same(env.step(random_actions(7, 3)), untouched.step(random_actions(7, 3)))


def test_step_before_reset_is_refused() -> None:
    """There is no flight yet."""
    for env, action in ((FormationEnv(), np.zeros(3)), (FormationVectorEnv(2), np.zeros((2, 3)))):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            env.step(action)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": 1}, r"unknown \['start'\]; known: initial_state"),
        ({"initial_state": np.zeros(5)}, r"initial_state: shape must be \(6,\)"),
        ({"initial_state": [0, NAN, 0, 0, 0, 0]}, "initial_state: must be finite"),
    ],
)
def test_wrong_reset_options_are_named_and_change_nothing(options: dict[str, Any], message: str) -> None:
    """A reset that fails leaves the running episode as it is."""
    for env, untouched, rows in (
        (FormationEnv(), FormationEnv(), ()),
        (FormationVectorEnv(2), FormationVectorEnv(2), (2,)),
    ):
        assert_same(env.reset(seed=4), untouched.reset(seed=4))
        with pytest.raises(ValueError, match=message):
            env.reset(seed=9, options=options)
        assert_same(env.step(random_actions(7, *rows)), untouched.step(random_actions(7, *rows)))
        assert_same(env.reset(), untouched.reset())
