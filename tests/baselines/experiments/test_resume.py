"""What was flown is kept as it finishes, and not flown again; times and tables survive as they were."""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from baselines.controllers.reference_policies import Zero, ZeroSettings
from baselines.experiments.cached_jobs import FOLDER, CachedJob, cached, place_of, read_table
from baselines.experiments.episodes import ACTION_TIME, CHUNK, Episodes, Flight, episode_jobs
from baselines.experiments.policy_factories import Classical
from baselines.experiments.run_comparison import ComparisonData, run_comparison
from baselines.report import ReportOptions, write_report
from baselines.report.write_sweep import SweepOptions, write_sweep
from baselines.result_cache import SUFFIX
from formation_env import Scenario, load_scenario
from formation_env.evaluation.rollout import record
from formation_env.settings import build

SHORT = {
    "title": "short",
    "phases": [{"formation": {"kind": "following", "y0_m": 200}, "transfer_orbits": 0.05, "hold_orbits": 0.05}],
}
OPTIONS = ReportOptions(
    episodes=4,
    slow_episodes=2,
    sweep_episodes=2,
    sweep_bound_episodes=0,
    resume=True,
    slow=("slow",),
    unswept=("slow",),
)
COMMAND = "python -m baselines report --resume"


@dataclass
class Counter:
    """Coasts, counts its actions, and gives up when it may have no more."""

    left: float = np.inf
    actions: int = 0

    def act(self) -> None:
        if self.actions >= self.left:
            raise KeyboardInterrupt
        self.actions += 1


class Watched(Zero):
    """Coasts, and tells a counter."""

    counter: Counter

    def predict(self, *arguments: Any, **named: Any) -> Any:
        self.counter.act()
        return super().predict(*arguments, **named)


@dataclass
class Coast:
    """A factory that tells its settings, and whose actions are counted."""

    told: dict[str, Any]
    counter: Counter = field(default_factory=Counter)

    def __call__(self, original: Scenario, believed: Scenario) -> Watched:
        policy = Watched(believed, ZeroSettings())
        policy.counter = self.counter
        return policy

    def settings(self, original: Scenario) -> dict[str, Any]:
        return self.told


def scenario() -> Scenario:
    return build(Scenario, SHORT, "test")


def fly(out: Path, factory: Coast, options: ReportOptions = OPTIONS) -> tuple[int, ComparisonData]:
    """Fly a fast and a slow policy, as the report does; how many actions that took, and what was found."""
    before = factory.counter.actions
    found = run_comparison({"fast": factory, "slow": factory}, {"short": scenario()}, options, out, 1)
    return factory.counter.actions - before, found


def assert_equal(one: ComparisonData, other: ComparisonData) -> None:
    """The same episodes, flights and points, but for the times of actions."""
    pd.testing.assert_frame_equal(one.sweep.episodes, other.sweep.episodes, check_exact=True)
    for name in ("fast", "slow"):
        (mine,), (theirs,) = one.flown, other.flown
        pd.testing.assert_frame_equal(mine.episodes[name], theirs.episodes[name], check_exact=True)
        flights = (item.flights[name].drop(columns=ACTION_TIME) for item in (mine, theirs))
        pd.testing.assert_frame_equal(*flights, check_exact=True)


def test_a_second_run_flies_nothing(tmp_path: Path) -> None:
    """With --resume not an action is asked for again, and all is found as it was."""
    actions, first = fly(tmp_path, Coast({"gain": 1.0}))
    assert actions > 0
    again, second = fly(tmp_path, Coast({"gain": 1.0}, Counter(left=0)))
    assert again == 0
    assert_equal(first, second)


def test_what_was_interrupted_goes_on(tmp_path: Path) -> None:
    """An interrupt in mid-flight: together the two runs ask for few more actions than one uninterrupted run."""
    whole, expected = fly(tmp_path / "whole", Coast({}))
    cut = Coast({}, Counter(left=whole // 2))
    with pytest.raises(KeyboardInterrupt):
        fly(tmp_path / "cut", cut)
    rest, found = fly(tmp_path / "cut", Coast({}))
    # what is lost is the unfinished job, and no job here is longer than an episode
    assert whole - cut.counter.actions <= rest <= whole - cut.counter.actions + scenario().num_steps
    assert_equal(found, expected)


@contextlib.contextmanager
def started(*arguments: object) -> Iterator[subprocess.Popen[bytes]]:
    """A Python process that is killed in the end."""
    process = subprocess.Popen([sys.executable, *map(str, arguments)], stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait_until(what: Callable[[], bool]) -> None:
    """Wait, for two minutes at most."""
    end = time.monotonic() + 120
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_killed_it_goes_on(tmp_path: Path) -> None:
    """SIGKILL in the second round leaves whole files, which another process finds under the same names and uses."""
    env, out = tmp_path / "short.yaml", tmp_path / "out"
    env.write_text(json.dumps(SHORT))
    arguments = [env, "--policy", "lqr", "--out", out, "--episodes", 2, "--sweep-episodes", 2]
    arguments += ["--bound-episodes", 0, "--resume", "--processes", 1]
    with started("-m", "baselines", "report", *arguments):
        wait_until(lambda: len(list(out.glob(f"{FOLDER}/point_*{SUFFIX}"))) >= 2)
    kept = {path: path.stat().st_mtime_ns for path in out.glob(f"{FOLDER}/[a-z]*{SUFFIX}")}
    assert not (out / "report.html").exists()
    options = ReportOptions(episodes=2, sweep_episodes=2, sweep_bound_episodes=0, resume=True)
    write_report({"lqr": Classical("lqr")}, [env], options, out, COMMAND)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert len(list(out.glob(f"{FOLDER}/[a-z]*{SUFFIX}"))) > len(kept)


SLEEPER = """
import sys, time
from pathlib import Path
from baselines.experiments.parallel import run

class Sleeper:
    cost = 1

    def run(self, progress):
        Path(sys.argv[1]).touch()
        time.sleep(600)

if __name__ == "__main__":
    run({"sleep": Sleeper()}, lambda cost: None, 2)
"""


def test_a_killed_main_process_leaves_no_worker(tmp_path: Path) -> None:
    """Nobody would ever tell a worker that there is no more to do."""
    script, begun = tmp_path / "sleeper.py", tmp_path / "begun"
    script.write_text(SLEEPER)
    with started(script, begun) as process:
        wait_until(begun.exists)
        workers = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert workers
    wait_until(lambda: not any(is_running(worker) for worker in workers))


def is_running(pid: str) -> bool:
    """Whether a process is there and no zombie, which only waits for somebody to ask how it ended."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def test_nothing_old_is_used_unasked(tmp_path: Path) -> None:
    """Without --resume, with other settings, or with a damaged file it is flown."""
    first, _ = fly(tmp_path, Coast({"gain": 1.0}))
    assert fly(tmp_path, Coast({"gain": 2.0}))[0] == first
    assert fly(tmp_path, Coast({"gain": 1.0}), replace(OPTIONS, resume=False))[0] == first
    for path in (tmp_path / FOLDER).iterdir():
        path.write_text("")
    assert fly(tmp_path, Coast({"gain": 1.0}))[0] == first


def test_the_sweep_is_resumed_too(tmp_path: Path) -> None:
    """The same for the sweep by itself."""
    options = SweepOptions(episodes=2, bound_episodes=0, resume=True)
    write_sweep({"coast": Coast({})}, [scenario()], options, tmp_path, COMMAND, 1)
    before = (tmp_path / "sweep.csv").read_bytes()
    write_sweep({"coast": Coast({}, Counter(left=0))}, [scenario()], options, tmp_path, COMMAND, 1)
    assert (tmp_path / "sweep.csv").read_bytes() == before


@dataclass(frozen=True)
class Table:
    """A job that gives a table."""

    table: pd.DataFrame
    key: Any = "key"
    cost: int = 3

    def run(self, progress: Any) -> pd.DataFrame:
        progress(self.cost)
        return self.table


def test_tables_are_kept_exactly(tmp_path: Path) -> None:
    """Floats to the last bit, flags, counts, what is missing, and labels that look like numbers or like nothing."""
    numbers = [1 / 3, np.nan, -1e-300, np.inf]
    table = pd.DataFrame({"policy": ["1", "NA", "", "nan"], "a": numbers, "b": [True, False, True, True], "seed": 7})
    jobs = cached({"job": Table(table)}, tmp_path)
    told: list[int] = []
    for _ in range(2):  # flown, then read
        pd.testing.assert_frame_equal(jobs["job"].run(told.append), table, check_exact=True)
    assert told == [3, 3]
    pd.testing.assert_frame_equal(read_table(place_of(tmp_path, Table(table))), table, check_exact=True)
    assert [path.suffix for path in tmp_path.iterdir()] == [SUFFIX]


def test_only_what_tells_its_settings_is_kept(tmp_path: Path) -> None:
    """Nobody knows whether an unknown policy is still the same."""
    unknown = Episodes(scenario(), "unknown", lambda original, believed: None, (0,), slow=False)
    known = Episodes(scenario(), "lqr", Classical("lqr"), (0,), slow=False)
    jobs = cached({"unknown": unknown, "known": known}, tmp_path)
    assert jobs["unknown"] is unknown
    assert isinstance(jobs["known"], CachedJob)


def test_kept_files_are_told_apart_by_all_that_matters(tmp_path: Path) -> None:
    """Scenario, label, settings and seeds; and an episode in numbers from a flight to look at."""
    keeping = load_scenario("keeping")
    jobs = [
        Episodes(keeping, "lqr", Classical("lqr"), (0,), slow=False),
        Episodes(keeping, "lqr", Classical("lqr"), (0, 1), slow=False),
        Episodes(keeping, "smc", Classical("lqr"), (0,), slow=False),
        Episodes(keeping, "lqr", Classical("smc"), (0,), slow=False),
        Episodes(scenario(), "lqr", Classical("lqr"), (0,), slow=False),
        Flight(keeping, "lqr", Classical("lqr"), 0, slow=False),
    ]
    assert len({place_of(tmp_path, job) for job in jobs}) == len(jobs)


def test_slow_policies_fly_the_first_seeds_in_small_jobs() -> None:
    """So that they spread over processes, and little is lost when they are interrupted."""
    policies = {"lqr": Classical("lqr"), "slow": Classical("mpc")}
    jobs = episode_jobs(policies, "env", scenario(), range(20, 40), {"slow": CHUNK + 1})
    assert jobs["env", "lqr", 20].seeds == tuple(range(20, 40))
    assert jobs["env", "slow", 20].seeds + jobs["env", "slow", 20 + CHUNK].seeds == tuple(range(20, 21 + CHUNK))
    assert len(jobs) == 3


def test_an_action_is_timed_for_one_observation() -> None:
    """A policy that thinks for 2 ms is said to take that long; the flight is the one that `record` gives."""

    class Thinker(Zero):
        def predict(self, observation: Any, *arguments: Any, **named: Any) -> Any:
            assert np.shape(observation) == (38,)
            time.sleep(2e-3)
            return super().predict(observation, *arguments, **named)

    job = Flight(scenario(), "thinker", lambda original, believed: Thinker(believed, ZeroSettings()), 3, slow=False)
    table = job.run(lambda cost: None)
    times_us = table[ACTION_TIME]
    assert np.isnan(times_us[0])
    assert (times_us[1:] >= 2000).all()
    plain = record(Zero(scenario(), ZeroSettings()), scenario(), 3)
    pd.testing.assert_frame_equal(table.drop(columns=ACTION_TIME), plain, check_exact=True)
