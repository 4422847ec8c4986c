"""Work that can be sent to other processes, and how it is done on all cores."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from multiprocessing.sharedctypes import Synchronized
from typing import Any, Final, Protocol, TypeVar

from tqdm import tqdm

POLL_S: Final = 0.2
"""How often the progress of other processes is asked for."""

Name = TypeVar("Name", bound=Hashable)
Progress = Callable[[int], Any]
"""Told the cost of what was flown since the last call."""


class Work(Protocol):
    """What can be sent to another process and flown there."""

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law."""
        ...

    def fly(self, progress: Progress) -> Any:
        """Fly it; progress is called with the cost of what was flown since the last call."""
        ...


class Share:
    """A job's progress in its own cost, whatever it counts itself.

    Args:
        progress: told the cost of what was flown since the last call.
        cost: of the whole job.
        total: what the job counts up to.
    """

    def __init__(self, progress: Progress, cost: int, total: int) -> None:
        self._progress, self._cost, self._total = progress, cost, total
        self._done = self._told = 0

    def advance(self, count: int) -> None:
        """So many more are done."""
        self._done += count
        self._tell(self._cost * self._done // self._total)

    def finish(self) -> None:
        """All is done, even where less was to do."""
        self._tell(self._cost)

    def _tell(self, cost: int) -> None:
        self._progress(cost - self._told)
        self._told = cost


def run(jobs: Mapping[Name, Work], progress: Progress, workers: int) -> dict[Name, Any]:
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


def fly(jobs: Mapping[Name, Work], workers: int) -> dict[Name, Any]:
    """Fly all jobs with a progress bar, and give what each found.

    Args:
        jobs: by name.
        workers: processes; with 1 all is flown in this one.
    """
    total = sum(job.cost for job in jobs.values())
    first = "flying (the very first run compiles the kernel)"
    with tqdm(total=total, desc=first, unit="step", unit_scale=True, smoothing=0.1, dynamic_ncols=True) as bar:
        return run(jobs, bar.update, workers)


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
    threading.Thread(target=_follow, daemon=True).start()


def _follow() -> None:
    """End this worker process when the main one is gone: killed, it cannot say so, and this would wait for ever."""
    main = multiprocessing.parent_process()
    assert main is not None, "a worker has one"
    main.join()
    os._exit(1)


def _fly(job: Work) -> Any:
    """Fly a job in a worker process."""
    counter = _counter
    assert counter is not None, "set by _begin"

    def advance(cost: int) -> None:
        with counter.get_lock():
            counter.value += cost

    return job.fly(advance)
