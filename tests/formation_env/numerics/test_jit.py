"""The cache of compiled code: damaged files, folders that cannot be written, and none at all."""

import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core import caching

from formation_env.numerics import jit

SOURCE = """
from formation_env.numerics.jit import compiled_loop


@compiled_loop
def total(values):
    result = 0.0
    for value in values:
        result += value
    return result
"""


@pytest.fixture(autouse=True)
def unwarned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test sees the warnings anew."""
    monkeypatch.setattr(jit, "_warned", set())


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], Any]:
    """Makes the function of SOURCE anew, as a new process does, with its cache in a folder of the test."""
    path = tmp_path / "a_loop.py"
    path.write_text(SOURCE, encoding="utf-8")
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "cache"))

    def make() -> Any:
        names: dict[str, Any] = {"__name__": "a_loop"}
        exec(compile(SOURCE, str(path), "exec"), names)
        return names["total"]

    return make


def sums(function: Any) -> float:
    """What the function makes of 1, 2, 3."""
    return float(function(np.array([1.0, 2.0, 3.0])))


def cached(tmp_path: Path, suffix: str) -> Path:
    """The one cache file of a kind."""
    (path,) = (tmp_path / "cache").rglob(f"*{suffix}")
    return path


def test_compiled_code_comes_from_the_cache(load: Callable[[], Any]) -> None:
    """The second process compiles nothing."""
    assert sums(load()) == 6
    again = load()
    assert sums(again) == 6
    assert again.stats.cache_hits.total() == 1


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [lambda data: b"", lambda data: data[: len(data) // 2], lambda data: b"\xff" * 99])
def test_a_damaged_cache_is_made_anew(
    load: Callable[[], Any], tmp_path: Path, suffix: str, damage: Callable[[bytes], bytes]
) -> None:
    """One line says so; the run after it finds a sound cache."""
    sums(load())
    path = cached(tmp_path, suffix)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.warns(RuntimeWarning, match=r"\Aformation_env: damaged cache .*cache.*compiled anew\Z"):
        assert sums(load()) == 6
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = load()
        assert sums(again) == 6
    assert again.stats.cache_hits.total() == 1


def test_without_a_folder_code_is_compiled_without_a_cache(
    load: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A read-only installation and no writable home: numba has no place, and one line names the way out."""
    locators = caching.CacheImpl._locator_classes
    for locator in locators:
        monkeypatch.setattr(locator, "from_function", classmethod(lambda cls, *_: None))
    with pytest.warns(RuntimeWarning, match=r"no locator available.*set NUMBA_CACHE_DIR to a folder that can be writ"):
        function = load()
    assert sums(function) == 6


def test_a_cache_that_cannot_be_written_stops_nothing(load: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk, for instance."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    function = load()
    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    with pytest.warns(RuntimeWarning, match=r"No space left on device.*NUMBA_CACHE_DIR"):
        assert sums(function) == 6


def test_a_read_only_installation_without_a_home_imports() -> None:
    """A new process whose numba finds no folder: one line for all compiled functions, and no traceback."""
    code = (
        "from numba.core import caching\n"
        "for locator in caching.CacheImpl._locator_classes:\n"
        "    locator.from_function = classmethod(lambda cls, *_: None)\n"
        "import baselines.design.riccati, formation_env\n"
        "from formation_env.kernel.program import Kinds, dispatchers\n"
        "dispatchers(Kinds('constant', 'constant', 'position', 'ideal', False, False)), formation_env.FormationEnv()"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    assert run.stderr.count("NUMBA_CACHE_DIR") == 1
