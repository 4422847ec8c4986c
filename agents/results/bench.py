"""Training speed of PPO on the batched environment, and the environment's share of the time."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from agents.algorithms.models import make_env, make_model
from agents.algorithms.ppo import PPOSettings
from formation_env.task.loading import load_scenario


@dataclass(frozen=True)
class Speed:
    """Speed of one rollout and the update on it.

    Attributes:
        steps_per_s: environment steps per second of wall time.
        steps_per_cpu_s: environment steps per second of processor time of all threads; independent of other programs.
        env_share: share of the wall time that the environment and its adapter take.
    """

    steps_per_s: float
    steps_per_cpu_s: float
    env_share: float


class TimedVecEnv(VecEnvWrapper):
    """Wrapper that measures the time that steps take.

    Attributes:
        seconds: total since the last reset of this counter, s.
    """

    seconds: float = 0.0

    def reset(self) -> NDArray[Any]:
        """Begin an episode in all rows; not timed."""
        observations = self.venv.reset()
        assert isinstance(observations, np.ndarray), "the environment's observations are one array"
        return observations

    def step(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Fly one step in all rows."""
        start_s = time.perf_counter()
        result = self.venv.step(actions)
        self.seconds += time.perf_counter() - start_s
        return result

    def step_wait(self) -> VecEnvStepReturn:
        """Part of a step; not timed by itself."""
        return self.venv.step_wait()


def measure(agent: PPOSettings, env_id: str, threads: int, rounds: int) -> list[Speed]:
    """Train for some rounds, each a rollout and the update on it, after an untimed one.

    Args:
        agent: hyperparameters.
        env_id: a registered id, or a scenario's name or path.
        threads: threads of torch.
        rounds: number of rounds.

    Returns:
        The speed of each round.
    """
    torch.set_num_threads(threads)
    env = TimedVecEnv(make_env(agent, load_scenario(env_id)))
    model, steps = make_model(agent, env, seed=0), agent.rows * agent.rollout_steps
    model.learn(steps)
    speeds = []
    for _ in range(rounds):
        env.seconds, start_s, start_cpu_s = 0.0, time.perf_counter(), time.process_time()
        model.learn(steps, reset_num_timesteps=False)
        elapsed_s = time.perf_counter() - start_s
        cpu_s = time.process_time() - start_cpu_s
        speeds.append(Speed(steps / elapsed_s, steps / cpu_s, env.seconds / elapsed_s))
    return speeds


def table(env_id: str, threads: Sequence[int], rounds: int) -> str:
    """Table of PPO's speed with its default settings: the fastest round for each number of threads."""
    agent, lines = PPOSettings(), []
    for count in threads:
        best = max(measure(agent, env_id, count, rounds), key=lambda speed: speed.steps_per_s)
        lines.append({"rows": agent.rows, "network": agent.network.hidden, "threads": count, **vars(best)})
    formats = dict.fromkeys(("steps_per_s", "steps_per_cpu_s"), "{:,.0f}".format) | {"env_share": "{:.1%}".format}
    return pd.DataFrame(lines).to_string(index=False, formatters=formats)
