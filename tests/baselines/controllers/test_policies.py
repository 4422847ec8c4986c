"""The contract of all policies: registry, gains, actions, batches, and Stable-Baselines3's evaluation."""

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from baselines import POLICIES, make_policy
from baselines.controllers.registry import read_settings, settings_path
from formation_env import ENV_IDS, ConfigError, FormationVectorEnv, load_scenario, scenario_names
from formation_env.numerics.arrays import Array
from formation_env.task.observation import SIZE, SLICES, observation_layout
from formation_env.task.scenario import Scenario

CONTROLLERS = ("lqr", "lqr_quasi_static", "smc")


@pytest.mark.parametrize("shipped", scenario_names())
def test_every_policy_flies_every_shipped_scenario(shipped: str) -> None:
    """Actions are finite float32 in [-1, 1], one at a time and in a batch, and a loop gives what the batch gives.

    The thesis's steps of a second are made ten: a plan of 58 000 steps takes a minute.
    """
    scenario = load_scenario(shipped)
    scenario = dataclasses.replace(scenario, dt_s=max(10.0, scenario.dt_s))
    env = FormationVectorEnv(3, scenario)
    for name in POLICIES:
        policy, other = (make_policy(name, scenario, settings_path(shipped)) for _ in range(2))
        observation, _ = env.reset(seed=0)
        for _ in range(5):
            action, state = policy.predict(observation)
            assert state is None
            assert action.dtype == np.float32
            assert action.shape == (3, 3)
            assert np.abs(action).max() <= 1
            alone = np.array([other.predict(row)[0] for row in observation])
            np.testing.assert_allclose(alone, action, rtol=1e-5, atol=1e-7)
            observation = env.step(action)[0]


@pytest.mark.parametrize("name", CONTROLLERS)
def test_closed_loops_are_stable(name: str) -> None:
    """With the gains of every shipped scenario the loop's eigenvalues lie inside the unit circle, in every hold.

    The gain is taken from the policy's actions: differences of two errors that are small enough for any boundary layer.
    """
    for scenario_name in scenario_names():
        scenario = load_scenario(scenario_name)
        model = scenario.filter_dynamics()
        for phase in range(len(scenario.phases)):
            K = -gain(make_policy(name, scenario_name), scenario, phase)
            radius = np.abs(np.linalg.eigvals(model.Phi - model.Gamma @ K)).max()
            assert radius < 1, (scenario_name, phase)


def gain(policy: Any, scenario: Scenario, phase: int) -> Array:
    """Derivative (3, 6) of the acceleration by the estimated error at the reference, in hold."""
    layout = observation_layout(scenario)
    errors = 1e-4 * np.diag([1, 1, 1, 1e-3, 1e-3, 1e-3])
    observation = np.zeros((12, SIZE), np.float32)
    observation[:, SLICES["error"]] = np.vstack([errors, -errors]) / layout.state_scale
    observation[:, SLICES["phase"]] = phase / len(scenario.phases)
    observation[:, SLICES["in_hold"]] = 1
    observation[:, SLICES["time_left"]] = scenario.phases[phase].hold_orbits / 2
    accelerations = policy.acceleration(observation)
    return ((accelerations[:6] - accelerations[6:]) / (2 * errors.diagonal()[:, None])).T


@pytest.mark.parametrize(("name", "share"), [("lqr", 0.3), ("smc", 0.3), ("lqr_quasi_static", 0.75)])
@pytest.mark.parametrize("env_id", ENV_IDS)
def test_controllers_beat_coasting_by_far(name: str, share: float, env_id: str) -> None:
    """The shipped gains cost less than no control in the registered environments; `lqr_quasi_static` lags."""
    from formation_env.evaluation.rollout import evaluate

    coast, flown = (evaluate(make_policy(n, env_id), env_id, range(8))["return"].mean() for n in ("zero", name))
    assert flown > share * coast


def test_random_has_its_own_generator() -> None:
    """Equal seeds give equal actions, different ones do not, and successive actions differ."""
    observation = np.zeros((4, SIZE), np.float32)
    same, twin, other = (make_policy("random", "keeping", {"seed": seed}) for seed in (1, 1, 2))
    first = same.predict(observation, deterministic=True)[0]
    np.testing.assert_array_equal(first, twin.predict(observation)[0])
    assert (first != other.predict(observation)[0]).all()
    assert (first != same.predict(observation)[0]).all()


def test_stable_baselines3_evaluates_a_baseline() -> None:
    """SB3's evaluate_policy, on one environment and on its VecEnv, gives the return of our own evaluation."""
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.monitor import Monitor

    from formation_env.evaluation.rollout import evaluate

    env_id = "FormationInitialization-v0"
    policy: Any = make_policy("smc", env_id)
    env = Monitor(gymnasium.make(env_id))
    env.reset(seed=7)
    mean, _ = evaluate_policy(policy, env, n_eval_episodes=1)
    assert -3 < mean < -1
    rows = make_vec_env(env_id, n_envs=2, seed=7)
    returns, lengths = evaluate_policy(policy, rows, n_eval_episodes=2, return_episode_rewards=True)
    expected = evaluate(policy, env_id, [7, 8])
    np.testing.assert_allclose(returns, expected["return"], rtol=1e-5)
    assert lengths == expected["steps"].tolist()


def test_gains_come_from_the_scenarios_file(tmp_path: Path) -> None:
    """By id, by name, by an equal object, by a changed object, and by an explicit file."""
    keeping = load_scenario("keeping")
    assert settings_path("FormationKeeping-v0").name == "keeping.yaml"
    assert settings_path("keeping").name == "keeping.yaml"
    assert settings_path(keeping).name == "keeping.yaml"
    assert settings_path(Scenario(phases=keeping.phases)).name == "default.yaml"
    own = tmp_path / "own.yaml"
    own.write_text("smc:\n  boundary_m: 3\n")
    assert make_policy("smc", "keeping", own).settings.boundary_m == 3
    assert make_policy("smc", "keeping", {"boundary_m": 4.0}).settings.boundary_m == 4
    settings = POLICIES["smc"].Settings(boundary_m=5.0)
    assert make_policy("smc", "keeping", settings).settings is settings


FAULTS = {
    "lqr:\n  hold: {control_s2: [1, 1]}\n": ("lqr", "hold.control_s2"),
    "lqr:\n  hold: {control_s2: [1, -1, 1]}\n": ("lqr", "hold.control_s2.1"),
    "lqr:\n  guidence: automatic\n": ("lqr", "guidence: unknown key; did you mean 'guidance'?"),
    "lqr:\n  guidance: curved\n": ("lqr", "guidance"),
    "lqr:\n  guidance: straight_line\n": ("lqr", "guidance: must be automatic with design reweighted_lqg"),
    "lqr_quasi_static:\n  feedforward: static\n": ("lqr_quasi_static", "feedforward"),
    "smc:\n  reaching: {kind: fast}\n": ("smc", "reaching.kind"),
    "smc:\n  reaching: {kind: relay, u0_m_s2: 0}\n": ("smc", "reaching.u0_m_s2"),
    "smc:\n  reaching: {kind: power, alpha: 2}\n": ("smc", "reaching.alpha"),
    "smc:\n  surface: {kind: placed, decay_per_s: '1e-3'}\n": ("smc", "surface.decay_per_s"),
    "smc:\n  boundary_m: ten\n": ("smc", "boundary_m"),
    "random:\n  seed: 1.5\n": ("random", "seed"),
    "lqg:\n  hold: {}\n": ("lqr", "lqg: no policy of that name; did you mean 'lqr'?"),
    "- lqr\n": ("lqr", "(top level)"),
}


@pytest.mark.parametrize("text", FAULTS)
def test_wrong_gains_are_refused_in_one_line(text: str, tmp_path: Path) -> None:
    """The message names the file and the key."""
    name, key = FAULTS[text]
    path = tmp_path / "gains.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        read_settings(name, path)
    assert str(error.value).startswith(f"{path}: ")
    assert key in str(error.value)
    assert "\n" not in str(error.value)


def test_unknown_names_are_refused() -> None:
    """A policy, scenario or gain file that is not there is named, with its nearest neighbour."""
    with pytest.raises(ConfigError, match="no policy named 'lqrr'; did you mean 'lqr'"):
        make_policy("lqrr", "keeping")
    with pytest.raises(ConfigError, match="no scenario named 'kepping'; did you mean"):
        make_policy("lqr", "kepping")
    with pytest.raises(ConfigError, match=r"nowhere\.yaml"):
        make_policy("lqr", "keeping", "nowhere.yaml")
    with pytest.raises(ConfigError, match="settings of lqr: hold: must be a mapping"):
        make_policy("lqr", "keeping", {"hold": 3})
