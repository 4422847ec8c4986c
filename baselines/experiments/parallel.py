"""Jobs on all cores: what a job is, and how jobs run in worker processes."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from typing import Any, Final, Protocol, TypeVar

from baselines.experiments.progress import in_words, progress_bar
from baselines.result_cache import discard_open_temporaries

POLL_S: Final = 0.2
"""Interval at which the progress of worker processes is read."""
STOP_S: Final = 2.0
"""Time that a worker has to end by itself before it is killed: a solver may hold the interpreter for a second."""
WORKER_DIED: Final = "a worker process died (killed, or out of memory); fewer --processes need less memory"

Name = TypeVar("Name", bound=Hashable)
Progress = Callable[[int], Any]
"""Called with the cost of the work done since the last call."""


class Job(Protocol):
    """Work that can be sent to another process."""

    @property
    def cost(self) -> int:
        """Estimated duration, in steps of a batch."""
        ...

    def run(self, progress: Progress) -> Any:
        """Do the work; progress is called with the cost of what was done since the last call."""
        ...


class ProgressShare:
    """Progress of a job in units of its own cost, whatever it counts itself.

    Args:
        progress: called with the cost of the work done since the last call.
        cost: of the whole job.
        total: count at the job's end.
    """

    def __init__(self, progress: Progress, cost: int, total: int) -> None:
        self._progress, self._cost, self._total = progress, cost, total
        self._done = self._reported = 0

    def advance(self, count: int) -> None:
        """Add a count of finished units."""
        self._done += count
        self._report(self._cost * self._done // self._total)

    def finish(self) -> None:
        """Report the whole cost, even where an early end left less to do."""
        self._report(self._cost)

    def _report(self, cost: int) -> None:
        self._progress(cost - self._reported)
        self._reported = cost


def run(
    jobs: Mapping[Name, Job], progress: Progress, workers: int, describe: Callable[[str], Any] = lambda text: None
) -> dict[Name, Any]:
    """Run all jobs, the longest first, and return their results by name.

    Args:
        jobs: by name.
        progress: called with the cost of the work done since the last call.
        workers: processes; with 1 all jobs run in this one.
        describe: called with the names of the jobs that are running.

    Raises:
        RuntimeError: a worker process died.
    """
    longest_first = sorted(jobs, key=lambda name: -jobs[name].cost)
    if workers > 1:
        return _run_in_workers({name: jobs[name] for name in longest_first}, progress, workers, describe)
    results = {}
    for name in longest_first:
        describe(label(name))
        results[name] = jobs[name].run(progress)
    return results


def run_with_bar(jobs: Mapping[Name, Job], workers: int, title: str = "flying") -> dict[Name, Any]:
    """Run all jobs with a progress bar, and return their results by name.

    Args:
        jobs: by name.
        workers: processes; with 1 all jobs run in this one.
        title: of the bar.

    Raises:
        RuntimeError: a worker process died.
    """
    with progress_bar(sum(job.cost for job in jobs.values()), title) as bar:
        bar.describe("starting; the very first run compiles the kernel")
        return run(jobs, bar.advance, workers, bar.describe)


def label(name: Hashable) -> str:
    """A job's name for people."""
    return " ".join(map(str, name)) if isinstance(name, tuple) else str(name)


def _run_in_workers(
    jobs: Mapping[Name, Job], progress: Progress, workers: int, describe: Callable[[str], Any]
) -> dict[Name, Any]:
    context = multiprocessing.get_context("spawn")
    counter = context.Value("q", 0)
    # Workers end when the writing end is closed: at once when this process stops them, or when it is killed itself.
    alive, stop = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, context, _begin, (counter, alive))
    try:
        with _interrupts_held():
            futures = {name: pool.submit(_run_job, job) for name, job in jobs.items()}
        _follow(futures, counter, progress, workers, describe)
        results = {name: future.result() for name, future in futures.items()}
    except BrokenProcessPool:
        _stop(pool, stop)
        raise RuntimeError(WORKER_DIED) from None
    except BaseException:
        _stop(pool, stop)
        raise
    pool.shutdown()
    return results


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold back Ctrl-C while workers start: they inherit that, and so end without a traceback of their imports."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow(
    futures: Mapping[Name, "Future[Any]"],
    counter: "Synchronized[int]",
    progress: Progress,
    workers: int,
    describe: Callable[[str], Any],
) -> None:
    """Show the workers' progress until all are done; raises what a job raised."""
    waiting, seen = set(futures.values()), 0
    while waiting:
        done, waiting = wait(waiting, POLL_S, FIRST_COMPLETED)
        for future in done:
            future.result()
        now = counter.value
        if now > seen:
            running = [label(name) for name, future in futures.items() if future in waiting and future.running()]
            describe(in_words(running[:workers]))
        progress(now - seen)
        seen = now


def _stop(pool: ProcessPoolExecutor, stop: Connection) -> None:
    """End the worker processes at once, in the midst of their jobs."""
    processes = multiprocessing.active_children()
    with suppress(OSError):
        stop.close()
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.join(STOP_S)
        if process.is_alive():
            process.kill()


_counter: "Synchronized[int] | None" = None
"""In a worker process: the cost of what all workers have done."""


def _begin(counter: "Synchronized[int]", alive: Connection) -> None:
    """Set up a worker process; Ctrl-C is for the main process, which then stops its workers."""
    global _counter
    _counter = counter
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_main, args=(alive,), daemon=True).start()


def _end_with_main(alive: Connection) -> None:
    """Exit when the main process stops its workers or dies: a killed parent cannot notify them."""
    with suppress(EOFError, OSError):
        alive.recv()
    discard_open_temporaries()
    os._exit(1)


def _run_job(job: Job) -> Any:
    """Run a job in a worker process."""
    counter = _counter
    assert counter is not None, "set by _begin"

    def advance(cost: int) -> None:
        with counter.get_lock():
            counter.value += cost

    return job.run(advance)
