"""Throughput of the environments, relative to Gymnasium's own environments measured in the same run."""

import itertools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any, Final

import gymnasium
import pandas as pd

from formation_env.evaluation import rivals
from formation_env.evaluation.rivals import ACTIONS, Stepper
from formation_env.registration import ENV_IDS, SWARM_IDS
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

REFERENCE: Final = "CartPole-v1"
"""The environment that the ratios refer to."""
REFERENCES: Final = (REFERENCE, "Pendulum-v1")
"""Gymnasium's environments measured beside ours."""
DEFAULT: Final = (*ENV_IDS, "keeping_nonlinear", *SWARM_IDS)
"""Environments that are measured unless others are named."""
_SINGLE_STEPS: Final = 3000
_BATCH_STEPS: Final = 400
_ROUNDS: Final = 5
_BATCH_ROUNDS: Final = 3


def single_stepper(env: str, steps: int) -> Stepper:
    """A function that steps one environment made with `gymnasium.make`, and returns the steps of all its followers.

    Args:
        env: a registered id, of Gymnasium's too, or a scenario's name or path.
        steps: steps per call.
    """
    env_id, arguments = _made_of(env)
    made: gymnasium.Env[Any, Any] = gymnasium.make(env_id, **arguments)
    made.reset(seed=0)
    made.action_space.seed(0)
    count = load_scenario(env).followers if env_id in SWARM_IDS else 1
    actions = itertools.cycle([made.action_space.sample() for _ in range(ACTIONS)])

    def run() -> int:
        for action in itertools.islice(actions, steps):
            _, _, terminated, truncated, _ = made.step(action)
            if terminated or truncated:
                made.reset()
        return steps * count

    return run


def batch_stepper(
    env: str | Scenario,
    rows: int,
    steps: int,
    thrust: float = 1.0,
    num_threads: int | None = None,
    begins: bool = False,
) -> Stepper:
    """A function that steps a batched environment, and returns the number of steps of all rows.

    Args:
        env: as of `single_stepper`, or a scenario.
        rows: rows of the batch: followers, of several in each group.
        steps: steps per call.
        thrust: greatest random action, of ours.
        num_threads: threads of ours; None: a number that suits the rows.
        begins: whether each call begins with a reset of all rows.
    """
    env_id, arguments = _made_of(env)
    is_ours = env_id in ENV_IDS or env_id in SWARM_IDS
    count = load_scenario(arguments.get("scenario", env_id)).followers if is_ours else 1
    if is_ours:
        arguments["num_threads"] = num_threads
    made = gymnasium.make_vec(env_id, rows // count, vectorization_mode="vector_entry_point", **arguments)
    made.reset(seed=0)
    made.action_space.seed(0)
    samples = [made.action_space.sample() for _ in range(min(ACTIONS, steps))]
    actions = itertools.cycle([thrust * sample for sample in samples] if is_ours and thrust < 1.0 else samples)

    def run() -> int:
        if begins:
            made.reset()
        for action in itertools.islice(actions, steps):
            made.step(action)
        return steps * rows

    return run


def _made_of(env: str | Scenario) -> tuple[str, dict[str, Any]]:
    """The id and the arguments that make an environment."""
    if isinstance(env, str) and env in gymnasium.registry:
        return env, {}
    ids = SWARM_IDS if load_scenario(env).followers > 1 else ENV_IDS
    return next(iter(ids)), {"scenario": env}


def rates(steppers: dict[str, Stepper], rounds: int = _ROUNDS) -> dict[str, float]:
    """Steps per second of each stepper: the best of some rounds in which all take turns, since clock rates vary."""
    best = dict.fromkeys(steppers, 0.0)
    for _ in range(rounds):
        for name, run in steppers.items():
            start = time.perf_counter()
            steps = run()
            best[name] = max(best[name], steps / (time.perf_counter() - start))
    return best


def startup(is_cached: bool = True) -> dict[str, float]:
    """Seconds that a new process takes to import the package and to fly its first steps.

    Args:
        is_cached: whether it finds compiled code in the cache, or compiles everything.
    """
    code = (
        "import time; a = time.perf_counter(); import formation_env; b = time.perf_counter();"
        "e = formation_env.FormationEnv(); e.reset(seed=0); e.step([0, 0, 0]); c = time.perf_counter();"
        "v = formation_env.FormationVectorEnv(64); v.reset(seed=0); v.step(v.action_space.sample());"
        "print(b - a, c - b, time.perf_counter() - c)"
    )
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ if is_cached else {**os.environ, "NUMBA_CACHE_DIR": empty}
        command = [sys.executable, "-c", code]
        output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    return dict(zip(("import", "first single step", "first batched step"), map(float, output.split()), strict=True))


def beside_rivals(env: str) -> tuple[pd.DataFrame, list[str]]:
    """Batched steps per second beside other packages that are installed, each in a batch of its own size.

    Args:
        env: as of `single_stepper`.

    Returns:
        A table as `table` gives it, and a line for each package that is left out.
    """
    groups, left_out = rivals.make_steppers()
    measured = []
    for rows, group in groups.items():
        ours = {name: batch_stepper(name, rows, _BATCH_STEPS) for name in (env, REFERENCE)}
        measured.append((f"batch of {rows}", rates(ours | group, _BATCH_ROUNDS)))
    return _lines(measured), left_out


def table(rows: int, envs: Sequence[str] = DEFAULT) -> pd.DataFrame:
    """Steps per second of all followers, and their ratio to CartPole's, single and in a batch.

    The actions are random, and the steps span whole episodes, so the time of resets is included.

    Args:
        rows: rows of the batches.
        envs: registered ids, or scenarios' names or paths.

    Returns:
        Columns: faces, env, steps_per_s, x_cartpole.
    """
    singles = rates({env: single_stepper(env, _SINGLE_STEPS) for env in (*envs, *REFERENCES)})
    batches = rates({env: batch_stepper(env, rows, _BATCH_STEPS) for env in (*envs, REFERENCE)}, _BATCH_ROUNDS)
    return _lines([("single", singles), (f"batch of {rows}", batches)])


def _lines(groups: Sequence[tuple[str, dict[str, float]]]) -> pd.DataFrame:
    """Rates of groups that each were measured beside the reference."""
    columns = ["faces", "env", "steps_per_s", "x_cartpole"]
    lines = [
        dict(zip(columns, (faces, env, rate, rate / group[REFERENCE]), strict=True))
        for faces, group in groups
        for env, rate in group.items()
    ]
    return pd.DataFrame(lines, columns=columns)
