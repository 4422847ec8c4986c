"""The cache is filled: what was compiled, found or loaded."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from formation_env.evaluation import fill_cache as module
from formation_env.evaluation.fill_cache import COMPILED, FOUND, LOADED, fill_cache

ALL = ("step", "reset", "look")


def test_environments_of_equal_kinds_share_a_program() -> None:
    """The second one has nothing left to do: single, batched and masked calls use the functions of the first."""
    first = fill_cache("keeping")
    assert tuple(first.origins) == ALL
    assert set(first.origins.values()) <= {COMPILED, FOUND, LOADED}
    assert first.folder is not None
    assert len(list(first.folder.glob("program.*.nbi"))) >= len(ALL)
    assert fill_cache("FormationReconfiguration-v0").origins == dict.fromkeys(ALL, LOADED)


def test_counts_tell_where_code_came_from() -> None:
    """More misses: compiled. More hits: found."""
    assert module._origin((0, 0), (1, 0)) == COMPILED
    assert module._origin((1, 0), (1, 1)) == FOUND
    assert module._origin((1, 1), (1, 1)) == LOADED


def test_a_full_cache_serves_every_way_to_fly(tmp_path: Path) -> None:
    """After one process has filled a cache, another that uses every call and option compiles nothing."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(Path(__file__).parents[3])}
    code = (
        "import numpy as np, formation_env as f;"
        "from formation_env.kernel.program import dispatchers, kinds_of, look_dispatcher;"
        "e = f.FormationEnv('keeping', analysis=True); e.reset(seed=0, options={'initial_state': np.ones(6)});"
        "e.step([0, 0, 0]); v = f.FormationVectorEnv(70, analysis=True); v.reset(seed=0);"
        "v.reset(options={'reset_mask': np.arange(70) < 2}); v.step(v.action_space.sample());"
        "p = (*dispatchers(kinds_of(e.unwrapped.scenario, 1)), look_dispatcher());"
        "print([sum(each.stats.cache_misses.values()) for each in p])"
    )
    fill = "from formation_env.evaluation.fill_cache import fill_cache; print(fill_cache('keeping').origins)"
    first, second = (
        subprocess.run([sys.executable, "-c", each], env=environment, capture_output=True, text=True, timeout=300)
        for each in (fill, code)
    )
    assert first.stdout.count(COMPILED) == len(ALL), first.stderr
    assert second.stdout == "[0, 0, 0]\n", second.stderr


def test_without_compilation_there_is_nothing_to_fill(monkeypatch: pytest.MonkeyPatch) -> None:
    """NUMBA_DISABLE_JIT leaves plain functions."""
    monkeypatch.setattr(module, "look_dispatcher", lambda: print)
    with pytest.raises(RuntimeError, match="NUMBA_DISABLE_JIT"):
        fill_cache("keeping")
