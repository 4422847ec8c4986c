"""Numba's cache, filled before the first use: by flying everything that is compiled once."""

import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from formation_env.envs.interface import START_OPTION
from formation_env.envs.single import FormationEnv
from formation_env.envs.vector import MASK_OPTION, FormationVectorEnv
from formation_env.kernel.program import Program, kinds_of, program
from formation_env.task.loading import load_scenario
from formation_env.task.variants import draw_variants

COMPILED, FOUND, LOADED = "compiled", "found in the cache", "loaded before"
_ROWS = 2


class Filled(NamedTuple):
    """What came of an environment.

    Attributes:
        origins: function of the program -> `COMPILED`, `FOUND`, or `LOADED` by an environment before it.
        seconds: time that the first flight took.
        folder: where the cache is; None if no folder can be written.
    """

    origins: dict[str, str]
    seconds: float
    folder: Path | None


def fill_cache(env: str) -> Filled:
    """Fly an environment, single and batched, so that its program is in the cache.

    Args:
        env: a registered id, or a scenario's name or path.

    Raises:
        ConfigError: the scenario is wrong.
        RuntimeError: numba compiles nothing because NUMBA_DISABLE_JIT is set.
    """
    scenario = load_scenario(env)
    functions = program(kinds_of(scenario, len(draw_variants(scenario))))
    if not hasattr(functions.step, "stats"):
        raise RuntimeError("nothing is compiled while NUMBA_DISABLE_JIT is set")
    single, batch = FormationEnv(scenario), FormationVectorEnv(_ROWS, scenario)
    given = scenario.start.formation.state(scenario.orbit)
    before = _counts(functions)
    start = time.perf_counter()
    single.reset(seed=0)
    single.reset(options={START_OPTION: given})  # a read-only array, which is another type to numba
    single.step(np.zeros(3, np.float32))
    batch.reset(seed=0)
    batch.step(np.zeros((_ROWS, 3), np.float32))
    batch.reset(options={MASK_OPTION: np.arange(_ROWS) == 0})  # which also looks at the rows that stay
    seconds = time.perf_counter() - start
    folder = functions.step.stats.cache_path
    origins = {name: _origin(before[name], after) for name, after in _counts(functions).items()}
    return Filled(origins, seconds, None if folder is None else Path(folder))


def _counts(functions: Program) -> dict[str, tuple[int, int]]:
    """How often the code of each function was compiled, and found in the cache, in this process."""
    return {name: _count(function) for name, function in functions._asdict().items()}


def _count(function: Any) -> tuple[int, int]:
    return sum(function.stats.cache_misses.values()), sum(function.stats.cache_hits.values())


def _origin(before: tuple[int, int], after: tuple[int, int]) -> str:
    """Where a function's code came from between two counts."""
    if after[0] > before[0]:
        return COMPILED
    return FOUND if after[1] > before[1] else LOADED
