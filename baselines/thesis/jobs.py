"""Flights as data, and flown on all cores: what to fly is a table of `Job`s."""

import multiprocessing
import signal
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from typing import Any, Final, Protocol

import numpy as np

from baselines.guidance import Guide
from baselines.policy import AccelerationPolicy
from baselines.thesis import scenarios
from baselines.thesis.flights import FEW, Flights, fly
from formation_env.scenario import Scenario

POLL_S: Final = 0.2
"""How often the progress of other processes is asked for."""
_ENVIRONMENT_COST: Final = 2
"""Time of a batch's step, in steps of one law."""


@dataclass(frozen=True)
class Law:
    """A control law with the thesis's gains, see `scenarios.law`.

    Attributes:
        name: of the policy.
        shipped: gain file.
        control_s2: factor of the control weight in place of the printed one, s^2.
    """

    name: str
    shipped: str
    control_s2: float | None = None

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """The policy for a scenario."""
        return scenarios.law(self.name, scenario, self.shipped, self.control_s2)


@dataclass(frozen=True)
class Job:
    """One batch of flights; the fields are `fly`'s arguments.

    Attributes:
        scenario: what is flown.
        laws: who flies it.
        seeds: one per episode of each law.
        guide: the desired path that errors are measured from.
        every: steps between kept instants.
        few: seeds whose states are kept.
        measured: whether their measurements are kept, too.
        start: true state (6,) to start at, if not the scenario's.
    """

    scenario: Scenario
    laws: tuple[Law, ...]
    seeds: tuple[int, ...]
    guide: Guide = "automatic"
    every: int = 1
    few: int = FEW
    measured: bool = False
    start: tuple[float, ...] | None = None

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law; the number of seeds hardly matters."""
        return self.scenario.num_steps * (_ENVIRONMENT_COST + len(self.laws))

    def fly(self, progress: Callable[[int], Any]) -> Flights:
        """Fly it; progress is called with the cost of what was flown since the last call."""
        share = _ENVIRONMENT_COST + len(self.laws)
        return fly(
            [law.make(self.scenario) for law in self.laws],
            self.scenario,
            self.seeds,
            self.guide,
            self.every,
            self.few,
            self.measured,
            None if self.start is None else np.array(self.start),
            lambda _: progress(share),
        )


class Work(Protocol):
    """A `Job`, or anything else that can be sent to another process and flown there."""

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law."""
        ...

    def fly(self, progress: Callable[[int], Any]) -> Any:
        """Fly it; progress is called with the cost of what was flown since the last call."""
        ...


def run(jobs: Mapping[str, Work], progress: Callable[[int], Any], workers: int) -> dict[str, Any]:
    """Fly all jobs, the longest ones first, and give what each found.

    Args:
        jobs: by name.
        progress: called with the cost of what was flown since the last call.
        workers: processes; with 1 all is flown in this one.
    """
    longest_first = sorted(jobs, key=lambda name: -jobs[name].cost)
    if workers == 1:
        return {name: jobs[name].fly(progress) for name in longest_first}
    context = multiprocessing.get_context("spawn")
    counter = context.Value("q", 0)
    with ProcessPoolExecutor(workers, context, _begin, (counter,)) as pool:
        try:
            futures = {name: pool.submit(_fly, jobs[name]) for name in longest_first}
            waiting, seen = set(futures.values()), 0
            while waiting:
                done, waiting = wait(waiting, POLL_S, FIRST_COMPLETED)
                for future in done:
                    future.result()  # raises what went wrong there
                now = counter.value
                progress(now - seen)
                seen = now
        except BaseException:
            _stop(pool)
            raise
        return {name: future.result() for name, future in futures.items()}


def _stop(pool: ProcessPoolExecutor) -> None:
    """End the processes at once, in the midst of their flights."""
    pool.shutdown(wait=False, cancel_futures=True)
    for process in multiprocessing.active_children():
        process.terminate()


_counter: "Synchronized[int] | None" = None
"""In a worker process: what all of them have flown."""


def _begin(counter: "Synchronized[int]") -> None:
    """Set up a worker process; an interrupt is for the main one, which then ends this."""
    global _counter
    _counter = counter
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _fly(job: Work) -> Any:
    """Fly a job in a worker process."""
    counter = _counter
    assert counter is not None, "set by _begin"

    def advance(cost: int) -> None:
        with counter.get_lock():
            counter.value += cost

    return job.fly(advance)
