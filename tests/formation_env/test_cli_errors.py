"""The error wrapper: what becomes one line, and what stays a traceback."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
from cli_helpers import environment, write_metadata

from formation_env.cli_errors import Interrupted, on_interrupt, one_line_errors
from formation_env.evaluation.seeds import seeds
from formation_env.files import check_writable
from formation_env.settings import ConfigError


def raising(error: BaseException) -> Callable[[], None]:
    def work() -> None:
        raise error

    return work


def terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(5)


@pytest.mark.parametrize(
    ("work", "code", "line"),
    [
        (raising(ConfigError("a.yaml: dt_s: must be > 0, got -1")), 2, "error: a.yaml: dt_s: must be > 0, got -1"),
        (
            lambda: seeds("test", 2_000_000) and None,
            2,
            "error: seeds: count must be between 1 and 1000000, got 2000000",
        ),
        (raising(PermissionError(13, "Permission denied", "reports/a")), 1, "error: reports/a: Permission denied"),
        (raising(OSError("no space")), 1, "error: no space"),
        (
            raising(BrokenProcessPool("x")),
            1,
            "error: a worker process died (killed, or out of memory); run again with fewer --processes",
        ),
        (raising(MemoryError()), 1, "error: out of memory; ask for fewer episodes, rows or processes"),
        (raising(KeyboardInterrupt()), 130, "interrupted, nothing written"),
        (raising(Interrupted("interrupted; 3 trials are saved")), 130, "interrupted; 3 trials are saved"),
        (terminate, 130, "interrupted, nothing written"),
    ],
)
def test_an_error_is_one_line_with_its_code(
    work: Callable[[], None], code: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit codes: 1 the work failed, 2 the input is wrong, 130 interrupted."""
    with pytest.raises(SystemExit) as ended, one_line_errors():
        work()
    assert ended.value.code == code
    assert capsys.readouterr().err == f"{line}\n"


@pytest.mark.parametrize("library", ["clarabel", "stable_baselines3", "jinja2.environment", "moviepy"])
def test_a_missing_library_names_its_extra(
    library: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The extra is read from the distribution's metadata, so it is the one of pyproject.toml."""
    monkeypatch.syspath_prepend(str(write_metadata(tmp_path)))
    extra = {"clarabel": "optimal", "stable_baselines3": "rl", "jinja2": "report", "moviepy": "video"}
    with pytest.raises(SystemExit) as ended, one_line_errors():
        raise ModuleNotFoundError(name=library)
    name = library.partition(".")[0]
    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        f"error: needs {name}; in a checkout: pip install -e '.[{extra[name]}]', or make\n"
    )


@pytest.mark.parametrize(
    "error", [ValueError("shapes (2,) (3,)"), RuntimeError("internal"), TypeError("bug"), KeyError("bug")]
)
def test_a_bug_keeps_its_traceback(error: Exception) -> None:
    """What another library or this test raises is no message for users."""
    with pytest.raises(type(error)), one_line_errors():
        raise error


def test_the_handler_of_sigterm_is_put_back() -> None:
    """The wrapper leaves the process as it was."""
    before = signal.getsignal(signal.SIGTERM)
    with one_line_errors():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_interrupt_says_what_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    """The innermost message counts."""
    with pytest.raises(SystemExit), one_line_errors(), on_interrupt("interrupted; the same command continues"):
        raise KeyboardInterrupt
    assert capsys.readouterr().err == "interrupted; the same command continues\n"


@pytest.mark.parametrize("module", ["formation_env", "baselines", "agents"])
def test_an_interrupt_during_imports_is_one_line(module: str, tmp_path: Path) -> None:
    """The first heavy import is the moment of the signal: no traceback, exit code 130."""
    code = (
        "import os, signal, sys\n"
        "class Interrupts:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numba':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.meta_path.insert(0, Interrupts())\n"
        f"from {module}.__main__ import main\n"
        "main()\n"
    )
    command = {"formation_env": ["env", "list"], "baselines": ["list"], "agents": ["report"]}[module]
    found = subprocess.run(
        [sys.executable, "-c", code, *command],
        env=environment(write_metadata(tmp_path / "site")),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert found.returncode == 130, found.stderr
    assert found.stderr.count("\n") == 1
    assert found.stderr.startswith("interrupted")


def test_check_writable_leaves_nothing_behind(tmp_path: Path) -> None:
    """A folder that is there, or can be made: no word and no file."""
    check_writable(tmp_path)
    check_writable(tmp_path / "new" / "below")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["file", "below a file", "dangling link", "system"])
def test_check_writable_names_the_folder(kind: str, tmp_path: Path) -> None:
    """A file in the way, a link to nowhere, a folder of the system."""
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    folder = {
        "file": tmp_path / "file",
        "below a file": tmp_path / "file" / "below",
        "dangling link": tmp_path / "link",
        "system": Path("/proc/none"),
    }[kind]
    with pytest.raises(OSError, match="cannot be written: ") as caught:
        check_writable(folder)
    assert caught.value.filename == str(folder)
