"""The commands that measure and compile: what they print and how they end; no value of a time."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cli_helpers import environment, write_metadata
from typer.testing import CliRunner, Result

from formation_env.cli import app
from formation_env.evaluation import bench, bench_ratios, soak
from formation_env.evaluation.soak import Reading
from formation_env.kernel import stage_times


def run(*arguments: str | Path) -> Result:
    """The result of `formation-env env ARGUMENTS`."""
    return CliRunner().invoke(app, ["env", *map(str, arguments)])


def test_bench_prints_stages_memory_and_rows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All four tables of a small batch, and the plot in a folder that it makes."""
    for name, number in {"_SINGLE_STEPS": 2, "_BATCH_STEPS": 2, "_ROUNDS": 1, "_BATCH_ROUNDS": 1}.items():
        monkeypatch.setattr(bench, name, number)
    small = {"ROWS": (2, 3, 4), "_STEPS": 2, "_ROW_STEPS": 600, "_SINGLE_STEPS": 2, "_EPISODES": 2}
    for name, value in small.items():
        monkeypatch.setattr(bench_ratios, name, value)
    monkeypatch.setattr(bench, "startup", lambda is_cached: {"import": 0.5})  # it compiles everything
    times = {"noise.draw": 5.0, stage_times.WHOLE: 50.0}
    monkeypatch.setattr(stage_times, "stage_times", lambda scenario, rows: times)  # it compiles each stage
    path = tmp_path / "new" / "rows.png"
    result = run("bench", "keeping", "--rows", "2", "--max-rows", "16", "--plot", path)
    assert result.exit_code == 0, result.output
    shown = ("x_cartpole", "ns_per_row", "noise.draw", "whole step", "bytes_per_row", "observations", "cartpole_ns")
    shown += ("import 0.50 s", "small thrust, 1 thread", "full thrust", "nonlinear truth", "the bare step")
    assert [text for text in shown if text not in result.stdout] == []
    assert result.stdout.splitlines()[-2].split()[0] == "16"
    assert path.read_bytes().startswith(b"\x89PNG")


def test_bench_refuses_another_kind_of_picture_before_the_work() -> None:
    """One line, exit code 2."""
    result = run("bench", "keeping", "--plot", "rows.svg")
    assert result.exit_code == 2
    assert result.stderr == "error: --plot: must end in .png, got rows.svg\n"
    assert result.stdout == ""


def test_compile_names_every_environment_and_the_folder() -> None:
    """Those of one follower share their program, so that only the first has something to do; so do the swarms."""
    result = run("compile")
    assert result.exit_code == 0, result.output
    *lines, last = result.stdout.splitlines()
    assert [line.split()[0] for line in lines] == [*bench.ENV_IDS, *bench.SWARM_IDS]
    first = {0, len(bench.ENV_IDS)}
    assert all("loaded before" in line for index, line in enumerate(lines) if index not in first)
    assert Path(last.removeprefix("cache: ")).is_dir()
    assert run("compile", "keepin").exit_code == 2


def test_soak_flies_and_says_growth() -> None:
    """Scientific notation; nothing is wrong with a short flight."""
    result = run("soak", "keeping", "--steps", "1e2", "--rows", "3", "--tolerance-mib", "1000")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-2].split()[:2] == ["102", "steps"]
    assert "memory grew by " in result.stdout


@pytest.mark.parametrize(("grown", "code"), [([100.0, 107.0], 0), ([100.0, 109.0], 1), ([None, None], 0)])
def test_soak_fails_if_memory_grows(grown: list[float | None], code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """8 MiB are tolerated; a system that tells no memory is no failure, and the output says so."""

    def fly(*_: Any) -> Iterator[Reading]:
        for steps, mib in enumerate(grown):
            yield Reading(steps, 0, mib)

    monkeypatch.setattr(soak, "fly", fly)
    result = run("soak")
    assert result.exit_code == code, result.output
    assert ("unknown" in result.stdout) == (grown[0] is None)
    assert result.stderr == ("error: memory grew by more than 8 MiB\n" if code else "")


def test_soak_ends_cleanly_at_ctrl_c(tmp_path: Path) -> None:
    """One line that says how far it came, exit code 130."""
    code = "from formation_env.__main__ import main; main()"
    command = [sys.executable, "-u", "-c", code, "env", "soak", "keeping", "--steps", "1e12", "--rows", "64"]
    own = environment(write_metadata(tmp_path))
    with subprocess.Popen(command, env=own, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "0 steps" in process.stdout.readline()  # after the warm-up
        os.kill(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert stderr.startswith("interrupted after ")
    assert stderr.count("\n") == 1
