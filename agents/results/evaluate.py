"""One policy on one environment's test seeds: a shipped file, a training run, or a user's own SB3 model."""

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

ALGORITHMS: Final = {"clip_range": "PPO", "target_entropy": "SAC", "policy_delay": "TD3"}
"""SB3's algorithms by a setting that no other has."""


class Sb3Policy:
    """A user's own model, with all that SB3 does around its network.

    Attributes:
        model: of SB3.
        throttle_power: p of the thrust sign(z) |z|^p that its actions z stand for; 1 if they are thrusts themselves.
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
    """A policy that can be read without unpickling: a .safetensors file with its card, or the folder of a run.

    Raises:
        ConfigError: it is neither, or faulty.
    """
    return load_best(source)[1] if source.is_dir() else load_policy(source)


def open_model(path: Path, allow_pickle: bool, throttle_power: float) -> Sb3Policy:
    """A user's own PPO, SAC or TD3 model.

    Args:
        path: SB3's file.
        allow_pickle: whether to load it at all: it holds pickled objects, which may run any code.
        throttle_power: see `Sb3Policy`.

    Raises:
        ConfigError: not allowed, no such model, or not for these environments; one line.
    """
    algorithm = algorithm_of(path)
    if not allow_pickle:
        raise ConfigError(
            f"{path}: holds pickled objects, which may run any code when they are loaded; "
            "give --allow-pickle if you trust where it comes from"
        )
    import stable_baselines3

    # a policy needs no memory of transitions
    model = getattr(stable_baselines3, algorithm).load(path, device="cpu", custom_objects={"buffer_size": 1})
    for name, space, shape in (
        ("observation", model.observation_space, (SIZE,)),
        ("action", model.action_space, (ACTIONS,)),
    ):
        if space.shape != shape:
            raise ConfigError(f"{path}: {name} space must have shape {shape}, got {space.shape}")
    return Sb3Policy(model, throttle_power)


def algorithm_of(path: Path) -> str:
    """Name of the SB3 class that saved a file; nothing is unpickled for it.

    Raises:
        ConfigError: it is no file of an algorithm in `ALGORITHMS`.
    """
    try:
        with ZipFile(path) as archive:
            settings = json.loads(archive.read("data"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (BadZipFile, KeyError, ValueError) as error:
        raise ConfigError(f"{path}: no file of Stable-Baselines3: {error}") from None
    found = [name for key, name in ALGORITHMS.items() if key in settings]
    if not found:
        raise ConfigError(f"{path}: of no algorithm that acts in these environments: {', '.join(ALGORITHMS.values())}")
    return found[0]


def score(policy: Policy, scenario: Scenario, episodes: int, bound_episodes: int, cache: Path) -> pd.DataFrame:
    """Mean and 95 % interval of each metric on the first test seeds, and of the cost over the bound.

    Args:
        policy: what flies.
        scenario: where.
        episodes: test seeds.
        bound_episodes: of these, seeds whose bound is solved; only where the solver is installed and the truth linear.
        cache: folder in which the bounds are kept; the report's has the same files.

    Returns:
        Index: metric, the last being `cost_over_bound` if it is known; columns: mean, low, high, seeds.
    """
    table = evaluate(policy, scenario, seeds("test", episodes))
    summary = summarise(table).rename(columns={"episodes": "seeds"})
    judged = seeds("test", episodes)[:bound_episodes]
    least = least_costs(scenario, judged, cache)
    if judged and least is not None:
        found = cost_ratio(-table["return"].to_numpy(float)[: len(judged)], least)
        summary.loc["cost_over_bound"] = [found.mean, found.low, found.high, len(judged)]
    return summary.astype({"seeds": int})


def least_costs(scenario: Scenario, judged: Sequence[int], cache: Path) -> Array | None:
    """The bound of each seed (seeds,), m/s; None where it is not known: no solver, or a nonlinear truth.

    Args:
        scenario: what is flown.
        judged: the seeds.
        cache: folder in which the bounds are kept.
    """
    from tqdm import tqdm

    if find_spec(SOLVER) is None or scenario.dynamics == NONLINEAR:
        return None
    shown = tqdm(judged, desc="bounds", unit="episode", leave=False, dynamic_ncols=True)
    return np.array([fuel_optimal(scenario, seed=seed, cache_folder=cache).cost for seed in shown])


def choose(source: Path, env: str | None, allow_pickle: bool, throttle_power: float | None) -> tuple[Policy, Scenario]:
    """The policy of any kind of file, and where it flies.

    Args:
        source: see `open_policy` and `open_model`.
        env: id, scenario's name or file; by default what the policy was trained on.
        allow_pickle: see `open_model`.
        throttle_power: of a user's own model, 1 by default; the other kinds say it themselves.

    Raises:
        ConfigError: a faulty source or environment, or one of the options does not go with the source.
    """
    if source.suffix == ".zip":
        if env is None:
            raise ConfigError(f"--env: {source} does not say what it was trained on; name it")
        return open_model(source, allow_pickle, throttle_power or 1.0), load_scenario(env)
    if throttle_power is not None:
        raise ConfigError(f"--throttle-power: only for a .zip; {source} says it itself")
    actor = open_policy(source)
    return actor, actor.scenario if env is None else load_scenario(env)
