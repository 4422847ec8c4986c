"""The adapter between the batched environment and Stable-Baselines3."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecNormalize

from agents.algorithms.vec_env import Sb3VecEnv
from formation_env import FormationVectorEnv, Scenario, load_scenario
from formation_env.settings import build
from formation_env.task.variants import draw_variants

ROWS = 5


def short_scenario(**changes: Any) -> Scenario:
    """A hold of 19 steps; the rows that drift beyond 150 m end before that."""
    phases = [{"formation": {"kind": "space_circle", "x0_m": 2000, "vx0_m_s": 0.2}, "hold_orbits": 0.1}]
    start = {"formation": phases[0]["formation"], "initial_sigma_pos_m": 50, "initial_sigma_vel_m_s": 0.05}
    data = {"spacecraft": {"max_accel_m_s2": 0.002}, "start": start, "phases": phases}
    return build(Scenario, data | {"limits": {"max_distance_m": 120}} | changes, "test")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return short_scenario()


def actions(steps: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (steps, ROWS, 3)).astype(np.float32)


def test_adapter_hands_on_what_the_batched_environment_gives(scenario: Scenario) -> None:
    """One environment, two faces: equal to the last bit, rewards up to float32, over many ends of both kinds."""
    adapter, batch = Sb3VecEnv(ROWS, scenario), FormationVectorEnv(ROWS, scenario)
    adapter.seed(7)
    np.testing.assert_array_equal(adapter.reset(), batch.reset(seed=7)[0])
    kinds, returns = set(), np.zeros(ROWS)
    for action in actions(80):
        observations, rewards, dones, infos = adapter.step(action)
        expected, true_rewards, terminated, truncated, batch_infos = batch.step(action)
        np.testing.assert_array_equal(observations, expected)
        np.testing.assert_array_equal(rewards, true_rewards.astype(np.float32))
        np.testing.assert_array_equal(dones, terminated | truncated)
        returns += true_rewards
        for row in range(ROWS):
            if not dones[row]:
                assert infos[row] == {}
                continue
            kinds.add(bool(terminated[row]))
            np.testing.assert_array_equal(infos[row]["terminal_observation"], batch_infos["final_obs"][row])
            assert infos[row]["TimeLimit.truncated"] == (truncated[row] and not terminated[row])
            assert infos[row]["episode"]["r"] == pytest.approx(returns[row], rel=1e-9)
            returns[row] = 0
    assert kinds == {True, False}, "the test must see both kinds of end"


def test_episode_statistics_are_those_of_monitor(scenario: Scenario) -> None:
    """SB3's own Monitor, around a single environment with the same seed, is the oracle (it rounds to 1e-6)."""
    single = Monitor(gymnasium.make("FormationKeeping-v0", scenario=scenario))
    adapter = Sb3VecEnv(ROWS, scenario)
    adapter.seed(20)
    adapter.reset()
    single.reset(seed=20)
    ended = False
    for action in actions(scenario.num_steps):
        _, _, dones, infos = adapter.step(action)
        if not ended:
            _, _, terminated, truncated, info = single.step(action[0])
            ended = terminated or truncated
            assert bool(dones[0]) == ended
            if ended:
                assert infos[0]["episode"]["l"] == info["episode"]["l"]
                assert infos[0]["episode"]["r"] == pytest.approx(info["episode"]["r"], abs=1e-6)
                assert infos[0]["episode"]["t"] > 0
    assert ended


def test_infos_are_made_for_rows_that_end_only(scenario: Scenario) -> None:
    """No work per row: one list for all steps, in which an ended row's info stands for one step and is its own."""
    adapter = Sb3VecEnv(ROWS, scenario)
    adapter.seed(7)
    adapter.reset()
    first, told = adapter.step(actions(1)[0])[3], set()
    for action in actions(2 * scenario.num_steps):
        dones, infos = adapter.step(action)[2:]
        assert infos is first
        assert [bool(info) for info in infos] == dones.tolist()
        ended = [id(info) for info in infos if info]
        assert len(set(ended)) == len(ended)
        told |= set(ended)
    assert told


def test_reward_scale_is_a_factor_and_leaves_the_statistics(scenario: Scenario) -> None:
    """What is learnt from is scaled, what is reported is in m/s."""
    plain, scaled = Sb3VecEnv(ROWS, scenario), Sb3VecEnv(ROWS, scenario, reward_scale=8.0)
    for env in (plain, scaled):
        env.seed(3)
        env.reset()
    for action in actions(scenario.num_steps):
        one, eight = plain.step(action), scaled.step(action)
        np.testing.assert_array_equal(8 * one[1], eight[1])  # a power of two: no rounding
        assert [info.get("episode", {}).get("r") for info in one[3]] == [
            info.get("episode", {}).get("r") for info in eight[3]
        ]


def test_actions_are_throttles(scenario: Scenario) -> None:
    """An action of the adapter is its power with its sign to the batched environment (powers of two: no rounding)."""
    adapter, batch = Sb3VecEnv(ROWS, scenario, throttle_power=3.0), FormationVectorEnv(ROWS, scenario)
    adapter.seed(9)
    adapter.reset()
    batch.reset(seed=9)
    throttles = np.tile(np.array([[-1, 0.5, 0], [1, -0.25, 0.125]], np.float32), (3, 1))[:ROWS]
    thrusts = np.tile(np.array([[-1, 0.125, 0], [1, -(2.0**-6), 2.0**-9]], np.float32), (3, 1))[:ROWS]
    for _ in range(10):
        np.testing.assert_array_equal(adapter.step(throttles)[0], batch.step(thrusts)[0])


def test_seeds_and_options_count_once(scenario: Scenario) -> None:
    """As in SB3's own vectorised environments: equal seeds, equal episodes; the next reset goes on with the stream."""
    adapter = Sb3VecEnv(ROWS, scenario)
    adapter.seed(11)
    first, second = adapter.reset(), adapter.reset()
    adapter.seed(11)
    np.testing.assert_array_equal(adapter.reset(), first)
    assert not np.array_equal(first, second)
    start = scenario.start.formation.state(scenario.orbit) + np.array([10.0, 0, 0, 0, 0, 0])
    adapter.set_options({"initial_state": start})
    adapter.seed(11)
    expected, _ = FormationVectorEnv(ROWS, scenario).reset(seed=11, options={"initial_state": start})
    np.testing.assert_array_equal(adapter.reset(), expected)
    assert not np.array_equal(expected, first)
    adapter.set_options([{"initial_state": start}] + [{}] * (ROWS - 1))
    with pytest.raises(ValueError, match="initial_state must be given to all rows or to none"):
        adapter.reset()


def test_staggered_rows_end_at_different_times() -> None:
    """With no early ends, rows begun evenly over an episode of N steps end evenly over N steps, and go on so."""
    scenario = short_scenario(limits={"max_distance_m": 50e3})
    adapter = Sb3VecEnv(ROWS, scenario, stagger=True)
    adapter.seed(5)
    adapter.reset()
    coast = np.zeros((ROWS, 3), np.float32)
    ends = [np.flatnonzero(adapter.step(coast)[2]) for _ in range(2 * scenario.num_steps)]
    steps = [step for step, rows in enumerate(ends) for _ in rows]
    begins = np.arange(ROWS) * scenario.num_steps // ROWS
    first = np.sort((begins - 1) % scenario.num_steps)
    expected = [*first, *(first + scenario.num_steps)]
    assert steps == expected


def test_rows_of_different_variants_are_staggered_too() -> None:
    """Coasting variants of different lengths: ends spread over an episode, and each episode as long as its variant."""
    ranges = {"variants": 8, "altitude_m": [300e3, 3000e3]}
    scenario = short_scenario(limits={"max_distance_m": 50e3}, domain_randomization=ranges)
    lengths = {variant.num_steps for variant in draw_variants(scenario)}
    assert len(lengths) > 4
    adapter = Sb3VecEnv(32, scenario, stagger=True)
    adapter.seed(5)
    adapter.reset()
    coast, ends = np.zeros((32, 3), np.float32), [list[int]() for _ in range(32)]
    for step in range(3 * max(lengths)):
        _, _, dones, infos = adapter.step(coast)
        for row in np.flatnonzero(dones):
            assert infos[row]["episode"]["l"] in lengths
            assert not ends[row] or step - ends[row][-1] == infos[row]["episode"]["l"]
            ends[row].append(step)
    assert min(len(times) for times in ends) >= 2
    assert len({times[0] for times in ends}) > 0.7 * min(lengths)


def test_attributes_and_methods_of_the_shared_environment(scenario: Scenario) -> None:
    """The rows share one environment: reading is for any of them, changing only for all."""
    adapter = Sb3VecEnv(ROWS, scenario)
    assert adapter.get_attr("scenario", [0, 2]) == [scenario] * 2
    assert not adapter.has_attr("no_such_thing")
    adapter.set_attr("render_mode", None)
    assert adapter.env_method("close") == [None] * ROWS
    assert adapter.env_is_wrapped(Monitor) == [True] * ROWS
    assert adapter.env_is_wrapped(gymnasium.wrappers.ClipAction, [1]) == [False]
    with pytest.raises(ValueError, match="set_attr: scenario: the rows share one environment"):
        adapter.set_attr("scenario", None, indices=[0])
    with pytest.raises(ValueError, match="env_method: close: the rows share one environment"):
        adapter.env_method("close", indices=1)


def test_stable_baselines_wrappers_and_evaluation_take_the_adapter(scenario: Scenario) -> None:
    """VecNormalize runs on it, and evaluate_policy finds the statistics without a warning."""
    env = VecNormalize(Sb3VecEnv(ROWS, scenario), norm_obs=False)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=20, n_epochs=1, seed=0, device="cpu")
    model.learn(2 * 8 * ROWS)
    returns, lengths = evaluate_policy(model, Sb3VecEnv(3, scenario), 6, return_episode_rewards=True)
    assert len(returns) == 6
    assert max(lengths) <= scenario.num_steps


def test_rollouts_are_those_of_stable_baselines_own_vectorised_environment() -> None:
    """`make_vec_env` with the same seeds is the oracle: equal to the last bit, ends, last observations and returns."""
    rows = 3
    plain, adapter = make_vec_env("FormationKeeping-v0", n_envs=rows, seed=4), Sb3VecEnv(rows, "FormationKeeping-v0")
    adapter.seed(4)
    np.testing.assert_array_equal(adapter.reset(), plain.reset())
    noise, ends = np.random.default_rng(2), 0
    for _ in range(2 * load_scenario("keeping").num_steps + 1):
        action = noise.normal(0, 0.01, (rows, 3)).astype(np.float32)
        ours, theirs = adapter.step(action), plain.step(action)
        for one, other in zip(ours[:3], theirs[:3], strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(ours[3], theirs[3], strict=True):
            if "episode" in other:
                ends += 1
                np.testing.assert_array_equal(one["terminal_observation"], other["terminal_observation"])
                assert one["TimeLimit.truncated"] == other["TimeLimit.truncated"]
                assert one["episode"]["r"] == pytest.approx(other["episode"]["r"], abs=1e-6)  # Monitor rounds
                assert one["episode"]["l"] == other["episode"]["l"]
    assert ends == 2 * rows


def test_an_end_that_is_one_leaves_no_value_behind(scenario: Scenario) -> None:
    """With bootstrap_end off, SB3 must not add the value of the last observation, whatever the end."""
    adapter = Sb3VecEnv(ROWS, scenario, bootstrap_end=False)
    adapter.seed(7)
    adapter.reset()
    told = [info["TimeLimit.truncated"] for action in actions(80) for info in adapter.step(action)[3] if info]
    assert len(told) > ROWS
    assert not any(told)


def test_stable_baselines_own_vectorised_environment_works() -> None:
    """The registered ids need no adapter."""
    env = make_vec_env("FormationKeeping-v0", n_envs=2, seed=0)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16, n_epochs=1, seed=0, device="cpu").learn(32)
    action, _ = model.predict(env.reset())
    assert action.shape == (2, 3)
    assert load_scenario("keeping") == env.get_attr("unwrapped")[0].scenario


def test_rows_go_on_from_what_they_remember(scenario: Scenario) -> None:
    """Put back in another environment, rows fly the same to the last bit, over ends and the episodes after them."""
    one, other = Sb3VecEnv(ROWS, scenario), Sb3VecEnv(ROWS, scenario)
    one.seed(8)
    one.reset()
    for action in actions(7):
        observations = one.step(action)[0]
    other.recall(one.memory(), observations)
    for action in actions(50):
        for mine, theirs in zip(one.step(action)[:3], other.step(action)[:3], strict=True):
            np.testing.assert_array_equal(mine, theirs)
