"""Numba's cache, filled before the first use."""

import time
from pathlib import Path
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher

from formation_env.kernel.group_program import group_dispatchers, group_kinds, group_program
from formation_env.kernel.program import dispatchers, kinds_of, look, look_dispatcher, program
from formation_env.task.loading import load_scenario
from formation_env.task.variants import draw_variants

COMPILED, FOUND, LOADED = "compiled", "found in the cache", "loaded before"


class Filled(NamedTuple):
    """What came of an environment.

    Attributes:
        origins: function of the program -> `COMPILED`, `FOUND`, or `LOADED` by an environment before it.
        seconds: time that it took.
        folder: where the cache is; None if no folder can be written.
    """

    origins: dict[str, str]
    seconds: float
    folder: Path | None


def fill_cache(env: str) -> Filled:
    """Compile the program of an environment, single and batched, unless it is in the cache.

    Args:
        env: a registered id, or a scenario's name or path.

    Raises:
        ConfigError: the scenario is wrong.
        RuntimeError: numba compiles nothing because NUMBA_DISABLE_JIT is set.
    """
    scenario = load_scenario(env)
    alone = scenario.followers == 1
    kinds = kinds_of(scenario, len(draw_variants(scenario))) if alone else group_kinds(scenario)
    functions: dict[str, Any] = (dispatchers if alone else group_dispatchers)(kinds)._asdict()
    if alone:
        functions["look"] = look_dispatcher()
    if not all(isinstance(function, Dispatcher) for function in functions.values()):
        raise RuntimeError("nothing is compiled while NUMBA_DISABLE_JIT is set")
    before = {name: _count(function) for name, function in functions.items()}
    start = time.perf_counter()
    if alone:
        program(kinds), look()
    else:
        group_program(kinds)
    seconds = time.perf_counter() - start
    folder = functions["step"].stats.cache_path
    origins = {name: _origin(before[name], _count(function)) for name, function in functions.items()}
    return Filled(origins, seconds, None if folder is None else Path(folder))


def _count(function: Any) -> tuple[int, int]:
    """How often the code of a function was compiled, and found in the cache, in this process."""
    return sum(function.stats.cache_misses.values()), sum(function.stats.cache_hits.values())


def _origin(before: tuple[int, int], after: tuple[int, int]) -> str:
    """Where a function's code came from between two counts."""
    if after[0] > before[0]:
        return COMPILED
    return FOUND if after[1] > before[1] else LOADED
