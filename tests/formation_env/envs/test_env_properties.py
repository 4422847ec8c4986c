"""What holds of an environment for any seed, any action and any start."""

import dataclasses

import numpy as np
from env_helpers import plan, restless
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from formation_env import FormationEnv, FormationVectorEnv, Scenario, load_scenario
from formation_env.dropout import Bernoulli
from formation_env.task.phases import Limits

SCENARIOS = {
    "keeping": load_scenario("keeping"),
    "mission": load_scenario("mission"),
    "restless": restless(),
    "keep-out": dataclasses.replace(load_scenario("keeping"), limits=Limits(keep_out_m=100.0), dropout=Bernoulli()),
}
ENVS = {name: FormationEnv(scenario) for name, scenario in SCENARIOS.items()}

FIRST = {name: plan(scenario)[0].reference for name, scenario in SCENARIOS.items()}

finite32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
actions = hnp.arrays(np.float32, (12, 3), elements=finite32)
offsets = hnp.arrays(float, 6, elements=st.floats(-1, 1))
seeds = st.integers(0, 2**32 - 1)


@given(st.sampled_from(sorted(ENVS)), seeds, actions, st.none() | offsets)
def test_any_flight_is_well_formed(
    name: str, seed: int, flown: NDArray[np.float32], offset: NDArray[np.float64] | None
) -> None:
    """Types and shapes as declared, in bounds, finite; nothing is ever gained; an end has its totals.

    Starts are as far off as the limits allow, and nearly as fast as the orbit itself.
    """
    env, options = ENVS[name], None
    if offset is not None:
        start = FIRST[name] + offset * np.repeat([0.57 * env.scenario.limits.max_distance_m, 4e3], 3)
        assume(np.linalg.norm(start[:3]) > env.scenario.limits.keep_out_m)
        options = {"initial_state": start}
    obs, info = env.reset(seed=seed, options=options)
    assert env.observation_space.contains(obs)
    for action in flown:
        obs, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(obs)
        assert (type(reward), type(terminated), type(truncated)) == (float, bool, bool)
        assert -np.inf < reward <= 0
        assert all(np.isfinite(value).all() for key, value in info.items() if key != "episode_totals")
        assert np.abs(info["accel_m_s2"]).max() <= env.scenario.spacecraft.max_accel_m_s2
        assert ("episode_totals" in info) == (terminated or truncated)
        if terminated or truncated:
            assert all(np.isfinite(list(info["episode_totals"].values())))
            break


@given(seeds, actions, st.integers(1, 40))
def test_any_row_is_the_single_environment(seed: int, flown: NDArray[np.float32], rows: int) -> None:
    """The last row of a batch of any size, among rows that act alike but started apart."""
    scenario: Scenario = SCENARIOS["restless"]
    single, batch = ENVS["restless"], FormationVectorEnv(rows, scenario)
    batch.reset(seed=seed)
    single.reset(seed=seed + rows - 1)
    for action in flown:
        obs, reward, terminated, truncated, info = single.step(action)
        all_obs, rewards, terminations, truncations, infos = batch.step(np.tile(action, (rows, 1)))
        assert (reward, terminated, truncated) == (rewards[-1], terminations[-1], truncations[-1])
        if terminated or truncated:
            np.testing.assert_array_equal(infos["final_obs"][-1], obs)
            break
        np.testing.assert_array_equal(all_obs[-1], obs)
        np.testing.assert_array_equal(infos["true_state"][-1], info["true_state"])


@given(seeds, st.integers(0, 2), st.floats(0, 1))
def test_thrust_only_ever_costs_its_delta_v_at_once(seed: int, axis: int, strength: float) -> None:
    """At one step from equal starts, thrust changes the reward by its delta-v and by the place it leads to, no more."""
    env, action = ENVS["keeping"], np.zeros(3, np.float32)
    env.reset(seed=seed)
    _, idle, _, _, still = env.step(action)
    action[axis] = strength
    env.reset(seed=seed)
    _, reward, _, _, moved = env.step(action)
    delta_v = 0.002 * float(action[axis]) * 30
    np.testing.assert_allclose(idle - reward, delta_v + moved["error_cost_m_s"] - still["error_cost_m_s"], atol=1e-12)
    # Half of a dt^2, and the n dt coupling between the axes.
    shift = np.linalg.norm(moved["true_state"][:3] - still["true_state"][:3])
    np.testing.assert_allclose(shift, 0.5 * delta_v * 30, rtol=2e-3, atol=1e-9)
