"""A pool of threads for compiled code that lets other threads run Python meanwhile.

numba's `prange` is not used: over GNU OpenMP its threads spin between two loops, and a forked process cannot use them.
"""

import contextlib
import ctypes
import os
import sys
from collections.abc import Callable
from numbers import Integral
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, Final

ROWS_PER_THREAD: Final = 4096
"""Flying fewer rows takes hardly longer than handing them to another thread, at least on a busy machine."""
_current_cpu: Any = getattr(ctypes.PyDLL(None), "sched_getcpu", None) if sys.platform == "linux" else None


def default_num_threads(num_rows: int) -> int:
    """Number of threads for a batch: one per `ROWS_PER_THREAD` rows, but at most the CPUs that this process may use."""
    return max(1, min(num_rows // ROWS_PER_THREAD, len(usable_cpus())))


def check_num_threads(num_threads: Any, num_rows: int) -> int:
    """The number of threads that was asked for; None: the default for this number of rows.

    Raises:
        ValueError: it is no integer, or below 1.
    """
    if num_threads is None:
        return default_num_threads(num_rows)
    if isinstance(num_threads, bool) or not isinstance(num_threads, Integral) or num_threads < 1:
        raise ValueError(f"num_threads: must be an integer and at least 1, got {num_threads!r}")
    return int(num_threads)


def run_parts(work: Callable[[int], int], num_parts: int) -> int:
    """Run the parts of some work side by side, and return when all have ended.

    Part 0 runs in the calling thread, which also takes each part that no worker has begun by then: nothing depends on
    how many workers are free. An interrupt (Ctrl-C) is raised after all parts have ended.

    Args:
        work: runs a part, given its number; parts must not wait for each other.
        num_parts: number of parts.

    Returns:
        The sum of what the parts return.

    Raises:
        BaseException: the first exception of the caller or of a part.
    """
    if num_parts == 1:
        return work(0)
    parts = [_Part(work, index) for index in range(num_parts)]
    errors: list[BaseException] = []
    try:
        _pool.hand_over(parts[1:])
    except RuntimeError:  # the system gives no more threads, or Python is about to exit: the caller runs the rest
        pass
    except BaseException as error:  # an interrupt
        errors.append(error)
    for action in (*(part.run_here for part in parts), *(part.wait for part in parts)):
        while True:
            try:
                action()
                break
            except BaseException as error:  # an interrupt: the actions may be repeated
                errors.append(error)
    errors += [part.error for part in parts if part.error is not None]
    if errors:
        raise errors[0]
    return sum(part.result for part in parts)


class _Part:
    """A part of some work, run by its worker or by the calling thread: by the first to claim it."""

    def __init__(self, work: Callable[[int], int], index: int) -> None:
        self.work, self.index = work, index
        self.claims: list[str] = []
        self.ended = False
        self.error: BaseException | None = None
        self.result = 0
        self.running = Lock()
        self.running.acquire()

    def run(self, claimant: str) -> None:
        """Run the part, unless another thread has claimed it."""
        self.claims.append(claimant)  # atomic
        if self.claims[0] == claimant:
            try:
                self.result = self.work(self.index)
            except BaseException as error:
                self.error = error
            self.ended = True

    def run_here(self) -> None:
        """Run the part in the calling thread, unless its worker has claimed it; once, however often it is called."""
        if "caller" not in self.claims:
            self.run("caller")

    def wait(self) -> None:
        """Wait until the worker has ended the part, if it has claimed it."""
        if self.claims[0] == "worker" and not self.ended:
            self.running.acquire()


class _Worker(Thread):
    """A daemon thread that runs the parts put into its queue, and is in the list `idle` while it has none."""

    def __init__(self, idle: "list[_Worker]") -> None:
        super().__init__(name="formation_env", daemon=True)
        self.parts: SimpleQueue[_Part] = SimpleQueue()
        self.idle = idle
        self.cpu = -1

    def run(self) -> None:
        """Run parts until the process ends."""
        while True:
            part = self.parts.get()
            part.run("worker")
            self.idle.append(self)  # before the caller goes on, and perhaps needs the worker again
            part.running.release()
            del part  # so that a sleeping worker keeps no array alive

    def bind(self, cpu: int) -> None:
        """Bind the thread to a CPU. Linux may otherwise wake it on the caller's CPU, and run the two in turn."""
        if cpu != self.cpu and self.native_id is not None:
            self.cpu = cpu
            with contextlib.suppress(OSError):  # the CPU is no longer allowed
                os.sched_setaffinity(self.native_id, {cpu})


class _Pool:
    """The workers of this process. It has no lock, so none can be held by another thread when the process forks."""

    def __init__(self) -> None:
        self.workers: list[_Worker] = []
        self.idle: list[_Worker] = []

    def hand_over(self, parts: list[_Part]) -> None:
        """Give each part to an idle or a new worker; parts without a worker are left to the caller."""
        cpus = usable_cpus()
        here = _current_cpu() if _current_cpu is not None and len(cpus) > 1 else None
        for part in parts:
            if not self.idle and len(self.workers) >= max(len(cpus), len(parts)):
                return
            try:
                worker = self.idle.pop()
            except IndexError:
                worker = self.new_worker()
            if here in cpus:
                worker.bind(cpus[(cpus.index(here) + part.index) % len(cpus)])
            worker.parts.put(part)

    def new_worker(self) -> _Worker:
        """A worker that sleeps."""
        worker = _Worker(self.idle)
        worker.start()
        self.workers.append(worker)
        return worker


def usable_cpus() -> list[int]:
    """Numbers of the CPUs that the calling thread may use."""
    return sorted(os.sched_getaffinity(0)) if sys.platform == "linux" else list(range(os.cpu_count() or 1))


def _forget_workers() -> None:
    """Begin a pool without workers, in a forked process: threads are not copied into it."""
    global _pool
    _pool = _Pool()


_pool = _Pool()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_workers)
