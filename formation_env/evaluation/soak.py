"""A long flight that watches the process's memory."""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from formation_env.envs.vector import FormationVectorEnv
from formation_env.task.scenario import Scenario

READINGS: Final = 10
"""Readings of the memory after the one that follows the warm-up."""
_STATUS: Final = Path("/proc/self/status")
_MIB: Final = 2**20


class Reading(NamedTuple):
    """Memory at a moment of the flight.

    Attributes:
        steps: flown by all rows together since the warm-up.
        episodes: ended since the warm-up.
        mib: resident memory, or None if this system does not tell.
    """

    steps: int
    episodes: int
    mib: float | None


def fly(
    scenario: Scenario, rows: int, steps: int, progress: Callable[[int], None] = lambda steps: None, seed: int = 0
) -> Iterator[Reading]:
    """Fly a batch with random actions; rows that end begin anew.

    The warm-up is one episode, at whose end all rows end together, which takes the most memory.

    Args:
        scenario: the scenario.
        rows: rows of the batch.
        steps: steps of all rows together, rounded up to whole steps of the batch.
        progress: called after each step of the batch with the steps flown since the warm-up.
        seed: of the environment and the actions.

    Yields:
        A reading after the warm-up, and some more at equal intervals up to the end.

    Raises:
        RuntimeError: a reward or an observation is not finite.
    """
    env, generator = FormationVectorEnv(rows, scenario), np.random.default_rng(seed)
    env.reset(seed=seed)
    _fly_some(env, generator, scenario.num_steps)
    yield Reading(0, 0, resident_mib())
    total, done, episodes = math.ceil(steps / rows), 0, 0
    for reading in range(1, READINGS + 1):
        while done < total * reading // READINGS:
            episodes += _fly_some(env, generator, 1)
            done += 1
            progress(done * rows)
        yield Reading(done * rows, episodes, resident_mib())


def _fly_some(env: FormationVectorEnv, generator: np.random.Generator, steps: int) -> int:
    """Fly some steps of the batch; returns how many episodes ended."""
    ended = 0
    for _ in range(steps):
        actions = 2 * generator.random((env.num_envs, 3), np.float32) - 1
        observations, rewards, terminations, truncations, _ = env.step(actions)
        if not (np.isfinite(rewards).all() and np.isfinite(observations).all()):
            raise RuntimeError("a reward or an observation is not finite")
        ended += int(np.count_nonzero(terminations | truncations))
    return ended


def resident_mib() -> float | None:
    """Resident memory of this process in MiB: now where Linux tells it, else the largest so far, else None."""
    if _STATUS.exists():
        for line in _STATUS.read_text(encoding="utf-8").splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest / (_MIB if sys.platform == "darwin" else 1024)


def growth_mib(readings: Sequence[Reading]) -> float | None:
    """Growth of the memory from the first reading to the last; None without two readings that tell it."""
    if len(readings) < 2 or readings[0].mib is None or readings[-1].mib is None:
        return None
    return readings[-1].mib - readings[0].mib
