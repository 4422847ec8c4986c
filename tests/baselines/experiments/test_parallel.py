"""Jobs in worker processes: what a worker's death, an interrupt and a killed main process leave behind."""

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from baselines.experiments import progress
from baselines.experiments.parallel import WORKER_DIED, ProgressShare, run
from baselines.experiments.progress import in_words, progress_bar

JOBS = """
import os, signal, sys, time
from pathlib import Path
import numpy as np
from baselines import result_cache
from baselines.experiments.parallel import run

class Job:
    cost = 1

    def __init__(self, folder, fault):
        self.folder, self.fault = folder, fault

    def run(self, progress):
        if self.fault == "memory":
            raise MemoryError("no memory")
        if self.fault != "wait":
            os.kill(os.getpid(), int(self.fault))
        def slow(self, data):
            (Path(folder) / "begun").touch()
            time.sleep(600)
        folder = self.folder
        Path.write_bytes = slow
        result_cache.entry(Path(folder), "job", 1).write({"a": np.zeros(3)})

if __name__ == "__main__":
    try:
        run({"one": Job(*sys.argv[1:]), "two": Job(*sys.argv[1:])}, lambda cost: None, 2)
    except (RuntimeError, MemoryError) as error:
        sys.exit(str(error))
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "jobs.py"
    path.write_text(JOBS)
    return path


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV])
def test_a_killed_worker_is_one_line(script: Path, tmp_path: Path, number: int) -> None:
    """No traceback, neither of the main process nor of the other workers."""
    command = [sys.executable, str(script), str(tmp_path), str(int(number))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (1, f"{WORKER_DIED}\n")


def test_a_worker_out_of_memory_says_so(script: Path, tmp_path: Path) -> None:
    """Its error is raised in the main process."""
    command = [sys.executable, str(script), str(tmp_path), "memory"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (1, "no memory\n")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_main_process_takes_workers_and_temporaries_with_it(script: Path, tmp_path: Path, number: int) -> None:
    """In the midst of writing a result: the workers end at once and leave no temporary file."""
    folder = tmp_path / "cache"
    folder.mkdir()
    with subprocess.Popen([sys.executable, str(script), str(folder), "wait"], stderr=subprocess.DEVNULL) as process:
        wait_until((folder / "begun").exists)
        wait_until(lambda: len(list(folder.glob(".job*"))) == 2)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        process.send_signal(number)
        process.wait()
    wait_until(lambda: not any(is_running(pid) for pid in children), limit_s=10)
    assert [path.name for path in folder.iterdir()] == ["begun"]


def wait_until(what: Callable[[], bool], limit_s: float = 120) -> None:
    end = time.monotonic() + limit_s
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def is_running(pid: str) -> bool:
    """Whether a process is there and no zombie."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def test_ctrl_c_while_workers_import_shows_no_traceback(script: Path, tmp_path: Path) -> None:
    """A terminal sends SIGINT to all processes of the group; only the main one answers."""
    command = [sys.executable, str(script), str(tmp_path), "wait"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        wait_until(lambda: len(children.read_text().split()) >= 2)  # the resource tracker and the first worker
        time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr is not None
        errors = process.stderr.read()
    assert errors.count("Traceback") == 1  # the script's own, which catches no interrupt
    assert "spawn_main" not in errors


def test_a_share_reports_the_jobs_cost() -> None:
    """In parts of its own count, and the rest at the end; by hand."""
    told: list[int] = []
    share = ProgressShare(told.append, cost=10, total=4)
    share.advance(1)
    share.advance(2)
    share.finish()
    assert told == [2, 5, 3]


def test_running_jobs_are_named() -> None:
    """In the order of their costs, in this process; a tuple's parts stand side by side."""

    class Nothing:
        def __init__(self, cost: int) -> None:
            self.cost = cost

        def run(self, progress: Callable[[int], object]) -> int:
            return self.cost

    said: list[str] = []
    jobs = {("keeping", "lqr", 0): Nothing(1), ("keeping", "mpc", 0): Nothing(5)}
    assert run(jobs, lambda cost: None, 1, said.append) == {name: job.cost for name, job in jobs.items()}
    assert said == ["keeping mpc 0", "keeping lqr 0"]
    assert in_words(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def test_a_log_gets_a_line_every_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal: whole lines without carriage returns, with what runs, the share and the time left."""
    now = [0.0]
    log = io.StringIO()
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(sys, "stderr", log)
    with progress_bar(100, "episodes") as bar:
        bar.describe("keeping lqr")
        for _ in range(50):
            now[0] += 0.5
            bar.advance(1)
    assert log.getvalue().splitlines() == [
        "episodes: started",
        "episodes: 20% after 0:10, about 0:40 left; keeping lqr",
        "episodes: 40% after 0:20, about 0:30 left; keeping lqr",
        "episodes: done in 0:25",
    ]
    assert "\r" not in log.getvalue()
