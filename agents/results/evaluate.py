"""Evaluation of a policy on test seeds: a shipped file, a training run, or a user's own SB3 model."""

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile, ZipFile

import numpy as np
import pandas as pd

from agents.policy.actor import ACTIONS, Actor
from agents.policy.library import load_policy
from agents.policy.throttle import throttle
from agents.training.run_folder import load_best
from baselines import cost_ratio, fuel_optimal
from baselines.optimal.cone_solver import SOLVER
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.rollout import Policy, evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import summarise
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.loading import load_scenario
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario

SB3_CLASSES: Final = {"clip_range": "PPO", "target_entropy": "SAC", "policy_delay": "TD3"}
"""SB3's algorithms by a setting that only they have."""


class Sb3Policy:
    """A user's own SB3 model, including the preprocessing of SB3's `predict`.

    Attributes:
        model: SB3 model.
        throttle_power: p of the thrust sign(z) |z|^p for its actions z; 1 if they are thrusts themselves.
    """

    def __init__(self, model: Any, throttle_power: float) -> None:
        self.model = model
        self.throttle_power = throttle_power

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Actions (3,) or (rows, 3), in units of max_accel_m_s2, for one observation or a batch; and the state."""
        z, state = self.model.predict(observation, state, episode_start, deterministic)
        return throttle(z, self.throttle_power), state


def open_policy(source: Path) -> Actor:
    """Load a policy without unpickling: a .safetensors file with its card, or the folder of a run.

    Raises:
        ConfigError: it is neither, or faulty.
    """
    return load_best(source)[1] if source.is_dir() else load_policy(source)


def open_model(path: Path, allow_pickle: bool, throttle_power: float | None) -> Sb3Policy:
    """Load a user's own PPO, SAC or TD3 model.

    Args:
        path: SB3's file.
        allow_pickle: permission to load it: its pickled objects can run any code.
        throttle_power: see `Sb3Policy`; None if not given.

    Raises:
        ConfigError: not allowed, not such a model, made for other environments, or a throttle power that the model
            contains already; one line.
    """
    algorithm = algorithm_of(path)
    if not allow_pickle:
        raise ConfigError(
            f"{path}: holds pickled objects, which may run any code when they are loaded; "
            "give --allow-pickle if you trust its source"
        )
    import stable_baselines3

    # A policy needs no replay buffer.
    model = getattr(stable_baselines3, algorithm).load(path, device="cpu", custom_objects={"buffer_size": 1})
    for name, space, shape in (
        ("observation", model.observation_space, (SIZE,)),
        ("action", model.action_space, (ACTIONS,)),
    ):
        if space.shape != shape:
            raise ConfigError(f"{path}: {name} space must have shape {shape}, got {space.shape}")
    own_power = getattr(model.policy, "throttle_power", None)  # of `agents.algorithms.throttle_policy`
    if own_power is not None and throttle_power is not None:
        raise ConfigError(f"--throttle-power: leave it out; {path} applies its own, {own_power}")
    return Sb3Policy(model, throttle_power or 1.0)


def algorithm_of(path: Path) -> str:
    """Name of the SB3 class that saved a file, found without unpickling.

    Raises:
        ConfigError: the file is missing, or not of an algorithm in `SB3_CLASSES`.
    """
    try:
        with ZipFile(path) as archive:
            settings = json.loads(archive.read("data"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (BadZipFile, KeyError, ValueError) as error:
        raise ConfigError(f"{path}: no file of Stable-Baselines3: {' '.join(str(error).split())}") from None
    classes = [name for key, name in SB3_CLASSES.items() if key in settings]
    if not classes:
        raise ConfigError(f"{path}: of no algorithm that acts in these environments: {', '.join(SB3_CLASSES.values())}")
    return classes[0]


def score(policy: Policy, scenario: Scenario, episodes: int, bound_episodes: int, cache: Path) -> pd.DataFrame:
    """Mean and 95 % interval of each metric on the first test seeds, and of the cost over the bound.

    Args:
        policy: policy to evaluate.
        scenario: task to fly.
        episodes: number of test seeds.
        bound_episodes: seeds among them whose bound is solved, if the solver is installed and the truth is linear.
        cache: folder of the cached bounds, which the report shares.

    Returns:
        Index: metric, `cost_over_bound` the last one if known; columns: mean, low, high, seeds.
    """
    table = evaluate(policy, scenario, seeds("test", episodes))
    summary = summarise(table).rename(columns={"episodes": "seeds"})
    bounded = seeds("test", episodes)[:bound_episodes]
    least = least_costs(scenario, bounded, cache)
    if bounded and least is not None:
        ratio = cost_ratio(-table["return"].to_numpy(float)[: len(bounded)], least)
        summary.loc["cost_over_bound"] = [ratio.mean, ratio.low, ratio.high, len(bounded)]
    return summary.astype({"seeds": int})


def least_costs(scenario: Scenario, episode_seeds: Sequence[int], cache: Path) -> Array | None:
    """Perfect-information bound of each seed (seeds,), m/s; None without a solver or for a nonlinear truth.

    Args:
        scenario: task that is flown.
        episode_seeds: seeds of the episodes.
        cache: folder of the cached bounds.
    """
    from tqdm import tqdm

    if find_spec(SOLVER) is None or scenario.dynamics == NONLINEAR:
        return None
    progress = tqdm(episode_seeds, desc="bounds", unit="episode", leave=False, dynamic_ncols=True)
    return np.array([fuel_optimal(scenario, seed=seed, cache_folder=cache).cost for seed in progress])


def choose(source: Path, env: str | None, allow_pickle: bool, throttle_power: float | None) -> tuple[Policy, Scenario]:
    """Load a policy of any kind, and the scenario that it flies.

    Args:
        source: see `open_policy` and `open_model`.
        env: id, scenario's name or file; by default the one that the policy was trained on.
        allow_pickle: see `open_model`.
        throttle_power: of a user's own model, 1 by default; the other kinds contain it.

    Raises:
        ConfigError: a faulty source or environment, or one of the options does not go with the source.
    """
    if not source.exists():
        raise ConfigError(f"{source}: cannot be read: No such file or folder")
    if source.suffix == ".zip":
        if env is None:
            raise ConfigError(f"ENV: {source} does not say what it was trained on; name it")
        return open_model(source, allow_pickle, throttle_power), load_scenario(env)
    if throttle_power is not None:
        raise ConfigError(f"--throttle-power: only for a .zip; {source} contains its own")
    actor = open_policy(source)
    return actor, actor.scenario if env is None else load_scenario(env)
