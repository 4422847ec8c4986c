"""How fast the environments step, beside Gymnasium's own in the same run, so that the ratio means something."""

import itertools
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, Final

import gymnasium
import pandas as pd

from formation_env.task.loading import ENV_IDS

RIVALS: Final = ("CartPole-v1", "Pendulum-v1")
VARIANTS: Final = {"keeping_nonlinear": "FormationKeeping-v0"}
"""Scenarios that are measured beside the ids' own, and the id that flies them."""
_ROUNDS: Final = 5
_ACTIONS: Final = 64


def single_stepper(env_id: str, steps: int) -> Callable[[], int]:
    """A function that takes some steps in one environment made with `gymnasium.make`; it returns how many.

    Args:
        env_id: an id, or one of `VARIANTS`.
        steps: how many each call takes.
    """
    env: gymnasium.Env[Any, Any] = gymnasium.make(VARIANTS.get(env_id, env_id), **_scenario(env_id))
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
    kind = VARIANTS.get(env_id, env_id)
    env = gymnasium.make_vec(kind, rows, vectorization_mode="vector_entry_point", **_scenario(env_id))
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = itertools.cycle([env.action_space.sample() for _ in range(_ACTIONS)])

    def run() -> int:
        for action in itertools.islice(actions, steps):
            env.step(action)
        return steps * rows

    return run


def _scenario(env_id: str) -> dict[str, Any]:
    """Arguments of a variant's environment."""
    return {"scenario": env_id} if env_id in VARIANTS else {}


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


def learning() -> int:
    """Have `agents`, which nothing here imports, print how fast PPO learns; its exit status."""
    return subprocess.call([sys.executable, "-m", "agents", "bench"])


def table(rows: int) -> pd.DataFrame:
    """Rates of all environments: columns steps_per_s and ratios to CartPole, for one environment and for a batch.

    The actions are random, and the steps span whole episodes, so resets have their share.
    """
    singles = rates({env_id: single_stepper(env_id, 3000) for env_id in (*ENV_IDS, *VARIANTS, *RIVALS)})
    batches = rates({env_id: batch_stepper(env_id, rows, 400) for env_id in (*ENV_IDS, *VARIANTS, RIVALS[0])}, rounds=3)
    lines = [
        {"faces": faces, "env": env_id, "steps_per_s": rate, "x_cartpole": rate / group[RIVALS[0]]}
        for faces, group in (("single", singles), (f"batch of {rows}", batches))
        for env_id, rate in group.items()
    ]
    return pd.DataFrame(lines)
