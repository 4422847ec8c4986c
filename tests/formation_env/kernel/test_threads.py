"""A batch stepped by several threads: equal results, and a pool that survives forks, errors and interrupts."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from env_helpers import assert_same, fly_rows, random_actions, restless
from stable_baselines3.common.vec_env import SubprocVecEnv

from formation_env import FormationEnv, FormationVectorEnv
from formation_env.kernel.threads import ROWS_PER_THREAD, default_num_threads, run_parts

ROWS, STEPS = 200, 40
PATIENCE_S = 30.0
"""Long beyond doubt: a test that waits so long has found a deadlock."""
FORKS = hasattr(os, "fork")
forks = pytest.mark.skipif(not FORKS, reason="this system does not fork")
# Python 3.12 and later warn of every fork of a process with threads, which is what these tests are about.
may_fork = pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")


def flight(num_threads: int) -> list[tuple[Any, ...]]:
    """A batch of four tiles, the last one not full, in which some rows end and begin again."""
    env = FormationVectorEnv(ROWS, restless(), analysis=True, num_threads=num_threads)
    return fly_rows(env, random_actions(3, STEPS, ROWS), seed=5)


@pytest.fixture(scope="module")
def expected() -> list[tuple[Any, ...]]:
    """The flight in one thread."""
    results = flight(1)
    assert any("final_obs" in result[-1] for result in results)
    return results


@pytest.mark.parametrize("num_threads", [2, 3, 9])
def test_any_number_of_threads_gives_the_same_bits(num_threads: int, expected: Any) -> None:
    """Parts of equal and unequal size, and more threads than tiles: no row is flown twice, no scratch is shared."""
    assert_same(flight(num_threads), expected)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_flies_beside_its_original(duplicate: Callable[[Any], Any]) -> None:
    """A copy has state and scratch space of its own for each thread, also when both are stepped at once."""
    env = FormationVectorEnv(ROWS, restless(), num_threads=2)
    actions = random_actions(4, STEPS, ROWS)
    fly_rows(env, actions[:5], seed=1)
    twin = duplicate(env)
    flown: dict[int, Any] = {}
    both = [
        threading.Thread(target=lambda e=e: flown.update({id(e): [e.step(action) for action in actions]}))  # type: ignore[misc]
        for e in (env, twin)
    ]
    join(both)
    assert_same(flown[id(twin)], flown[id(env)])


@pytest.mark.parametrize("bad", [0, -1, 1.5, 2.0, "2", True])
def test_a_wrong_number_of_threads_is_refused(bad: Any) -> None:
    """In one line that names the argument."""
    with pytest.raises(ValueError, match=r"^num_threads: must be an integer and at least 1, got .*$"):
        FormationVectorEnv(2, num_threads=bad)


def test_small_batches_have_one_thread_by_default() -> None:
    """More would be slower; large ones have no more threads than CPUs."""
    assert default_num_threads(1) == default_num_threads(2 * ROWS_PER_THREAD - 1) == 1
    assert 1 <= default_num_threads(2 * ROWS_PER_THREAD) <= 2
    assert default_num_threads(10**9) <= (os.cpu_count() or 1)


def join(threads: list[threading.Thread]) -> None:
    """Start threads and wait for their end."""
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
        assert not thread.is_alive(), "deadlock"


class Meeting:
    """Two parts of which part 0 waits until part 1 has begun, so that a worker surely runs part 1."""

    def __init__(self, in_worker: Callable[[], Any] = lambda: None) -> None:
        self.begun = threading.Event()
        self.in_worker = in_worker
        self.ended: list[int] = []
        self.threads: dict[int, threading.Thread] = {}

    def __call__(self, part: int) -> int:
        self.threads[part] = threading.current_thread()
        if part == 0:
            assert self.begun.wait(PATIENCE_S), "no worker came"
        else:
            self.begun.set()
            self.in_worker()
        self.ended.append(part)
        return 10 + part


def test_part_0_runs_in_the_caller_and_another_in_a_daemon() -> None:
    """The sum of both comes back, and a second run needs no further thread."""
    for _ in range(2):
        meeting = Meeting()
        assert run_parts(meeting, 2) == 21
        assert meeting.threads[0] is threading.current_thread()
        assert meeting.threads[1].daemon


def test_every_part_runs_once() -> None:
    """Also where there are more parts than workers can be quick enough for."""
    for _ in range(200):
        ran: list[int] = []
        run_parts(lambda part: ran.append(part) or 0, 7)  # type: ignore[func-returns-value]  # noqa: B023
        assert sorted(ran) == list(range(7))


@pytest.mark.parametrize("failing", [0, 1, 2])
def test_an_exception_comes_after_the_end_of_all_parts(failing: int) -> None:
    """Whichever part it is; the pool works on."""
    ended = []

    def work(part: int) -> int:
        if part == failing:
            raise KeyError(part)
        time.sleep(0.02)
        ended.append(part)
        return 1

    with pytest.raises(KeyError, match=str(failing)):
        run_parts(work, 3)
    assert sorted(ended) == sorted({0, 1, 2} - {failing})
    assert run_parts(lambda _: 1, 3) == 3


def test_three_threads_and_nested_calls_share_the_pool() -> None:
    """Each gets its own sum: none waits for a worker that waits for it."""
    sums = []

    def nested(part: int) -> int:
        return run_parts(lambda inner: 10 * part + inner, 3)

    def caller() -> None:
        sums.extend(run_parts(nested, 3) for _ in range(100))

    join([threading.Thread(target=caller) for _ in range(3)])
    assert sums == [99] * 300


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="the test sends a signal to a thread")
def test_an_interrupt_of_the_waiting_caller_leaves_no_part_running() -> None:
    """Ctrl-C while the worker is at work is raised when the worker has ended, which then serves the next call."""

    def interrupt_twice() -> None:
        for _ in range(2):
            time.sleep(0.05)
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        time.sleep(0.05)

    meeting = Meeting(interrupt_twice)
    with pytest.raises(KeyboardInterrupt):
        run_parts(meeting, 2)
    assert meeting.ended == [0, 1]
    assert run_parts(Meeting(), 2) == 21


def test_a_sleeping_worker_keeps_nothing_alive() -> None:
    """Else the arrays of an environment that was deleted would stay until the next step of another one."""
    meeting = Meeting()
    run_parts(meeting, 2)
    memory = weakref.ref(meeting)
    del meeting
    deadline = time.monotonic() + PATIENCE_S
    while memory() is not None and time.monotonic() < deadline:
        time.sleep(0.01)
    assert memory() is None


@pytest.mark.skipif(sys.platform != "linux", reason="threads are bound to CPUs on Linux only")
def test_a_worker_is_bound_and_its_caller_is_not() -> None:
    """The worker may use one CPU, where there are several; the caller's choice of CPUs is its own."""
    allowed = os.sched_getaffinity(0)
    chosen: list[set[int]] = []
    run_parts(Meeting(lambda: chosen.append(os.sched_getaffinity(0))), 2)
    assert os.sched_getaffinity(0) == allowed
    assert chosen[0] <= allowed
    assert len(chosen[0]) == 1


def test_workers_are_made_on_first_use_and_end_with_the_process() -> None:
    """A batch in one thread makes none; neither idle nor running workers delay the end."""
    code = (
        "import threading, numpy as np; from formation_env import FormationVectorEnv\n"
        "def count(threads):\n"
        "    env = FormationVectorEnv(200, num_threads=threads); env.reset(seed=0); env.step(np.zeros((200, 3)))\n"
        "    return sum(thread.name == 'formation_env' for thread in threading.enumerate())\n"
        "assert count(1) == 0 and count(3) == 2\n"
        "def forever():\n"
        "    while True: count(2)\n"
        "threading.Thread(target=forever, daemon=True).start(); import time; time.sleep(0.3)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def send_flight(pipe: Any) -> None:
    """Fly in a child process, in which a worker surely takes a part."""
    assert run_parts(Meeting(), 2) == 21
    pipe.send(flight(2))


@may_fork
@pytest.mark.parametrize("method", [pytest.param("fork", marks=forks), "spawn"])
def test_a_child_process_steps_after_its_parent_did(method: str, expected: Any) -> None:
    """A forked child has a pool without threads, and makes its own, while the parent's threads were at work."""
    run_parts(Meeting(), 2)
    stop = threading.Event()
    others = [threading.Thread(target=lambda: run_until(stop)) for _ in range(2)]
    for other in others:
        other.start()
    context: Any = multiprocessing.get_context(method)
    for _ in range(5 if method == "fork" else 1):
        mine, its = context.Pipe()
        child = context.Process(target=send_flight, args=(its,))
        child.start()
        assert mine.poll(4 * PATIENCE_S), "deadlock in the child"
        assert_same(mine.recv(), expected)
        child.join(PATIENCE_S)
        assert child.exitcode == 0
    stop.set()
    for other in others:
        other.join(PATIENCE_S)


def run_until(stop: threading.Event) -> None:
    """Keep the pool busy."""
    while not stop.is_set():
        run_parts(lambda part: part, 3)
        time.sleep(0.001)


class WithBatch(FormationEnv):
    """An environment whose reward is the sum of a batch's, which two threads step."""

    def __init__(self) -> None:
        super().__init__()
        self.batch = FormationVectorEnv(ROWS, num_threads=2)

    def reset(self, **arguments: Any) -> Any:
        """Begin an episode of both."""
        self.batch.reset(seed=0)
        return super().reset(**arguments)

    def step(self, action: Any) -> Any:
        """Fly both."""
        observation, _, terminated, truncated, info = super().step(action)
        rewards = self.batch.step(np.tile(action, (ROWS, 1)))[1]
        return observation, float(rewards.sum()), terminated, truncated, info


def rewards_here() -> list[float]:
    """Rewards in this process, which uses the pool."""
    env = WithBatch()
    env.reset(seed=0)
    return [env.step(np.full(3, 0.5, np.float32))[1] for _ in range(10)]


@forks
@may_fork
@pytest.mark.parametrize("library", ["gymnasium", "sb3"])
def test_environments_in_forked_processes_may_have_threads(library: str) -> None:
    """The children of Gymnasium's and SB3's vector environments, after the parent used the pool."""
    expected = rewards_here()
    makers = [WithBatch, WithBatch]
    envs: Any = (
        gymnasium.vector.AsyncVectorEnv(makers, context="fork")
        if library == "gymnasium"
        else SubprocVecEnv(makers, start_method="fork")  # type: ignore[arg-type]
    )
    envs.reset()
    rewards = [envs.step(np.full((2, 3), 0.5, np.float32))[1] for _ in range(10)]
    envs.close()
    np.testing.assert_array_equal(np.array(rewards), np.repeat(np.array(expected)[:, None], 2, axis=1))
