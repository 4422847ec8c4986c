"""How fast the environments step, beside Gymnasium's own in the same run, so that the ratio means something."""

import itertools
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

import gymnasium
import pandas as pd

from formation_env.registration import ENV_IDS

RIVALS: Final = ("CartPole-v1", "Pendulum-v1")
MEASURED: Final = (*ENV_IDS, "keeping_nonlinear")
"""Environments measured by default: the registered ids, and one with the nonlinear truth."""
_ROUNDS: Final = 5
_ACTIONS: Final = 64


def single_stepper(env_id: str, steps: int) -> Callable[[], int]:
    """A function that takes some steps in one environment made with `gymnasium.make`; it returns how many.

    Args:
        env_id: a registered id of Gymnasium, or a scenario's name or YAML file.
        steps: how many each call takes.
    """
    env: gymnasium.Env[Any, Any] = gymnasium.make(_registered(env_id), **_scenario(env_id))
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = itertools.cycle([env.action_space.sample() for _ in range(_ACTIONS)])

    def run() -> int:
        for action in itertools.islice(actions, steps):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return steps

    return run


def batch_stepper(env_id: str, rows: int, steps: int) -> Callable[[], int]:
    """The same for the batched environment; a step of all rows counts as many."""
    env = gymnasium.make_vec(_registered(env_id), rows, vectorization_mode="vector_entry_point", **_scenario(env_id))
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = itertools.cycle([env.action_space.sample() for _ in range(_ACTIONS)])

    def run() -> int:
        for action in itertools.islice(actions, steps):
            env.step(action)
        return steps * rows

    return run


def _registered(env: str) -> str:
    """The id itself, or an id of ours that takes a scenario."""
    return env if env in gymnasium.registry else next(iter(ENV_IDS))


def _scenario(env: str) -> dict[str, Any]:
    """Arguments of an environment that has no id of its own."""
    return {} if env in gymnasium.registry else {"scenario": env}


def rates(steppers: dict[str, Callable[[], int]], rounds: int = _ROUNDS) -> dict[str, float]:
    """Steps per second of each, the best of some rounds in which all take turns (the clock of a machine is noisy)."""
    best = dict.fromkeys(steppers, 0.0)
    for _ in range(rounds):
        for name, run in steppers.items():
            start = time.perf_counter()
            steps = run()
            best[name] = max(best[name], steps / (time.perf_counter() - start))
    return best


def startup() -> dict[str, float]:
    """Seconds of a new process to import the package, and to its first reset and step (compiled code is cached)."""
    code = (
        "import time; a = time.perf_counter(); import formation_env; b = time.perf_counter();"
        "e = formation_env.FormationEnv(); e.reset(seed=0); e.step([0, 0, 0]); c = time.perf_counter();"
        "v = formation_env.FormationVectorEnv(64); v.reset(seed=0); v.step(v.action_space.sample());"
        "print(b - a, c - b, time.perf_counter() - c)"
    )
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return dict(zip(("import", "first single step", "first batched step"), map(float, output.split()), strict=True))


def table(rows: int, envs: Sequence[str] = MEASURED) -> pd.DataFrame:
    """Rates of environments: columns steps_per_s and ratios to CartPole, for one environment and for a batch.

    The actions are random, and the steps span whole episodes, so resets have their share.

    Args:
        rows: of the batch.
        envs: registered ids, scenario names or YAML files; Gymnasium's own are measured with them.
    """
    singles = rates({env_id: single_stepper(env_id, 3000) for env_id in (*envs, *RIVALS)})
    batches = rates({env_id: batch_stepper(env_id, rows, 400) for env_id in (*envs, RIVALS[0])}, rounds=3)
    lines = [
        {"faces": faces, "env": env_id, "steps_per_s": rate, "x_cartpole": rate / group[RIVALS[0]]}
        for faces, group in (("single", singles), (f"batch of {rows}", batches))
        for env_id, rate in group.items()
    ]
    return pd.DataFrame(lines)
