"""The step's speed where it matters, each time beside what it is measured by, stepped in the same run."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, NamedTuple

from formation_env.evaluation.bench import REFERENCE, batch_stepper, rates, single_stepper
from formation_env.evaluation.rivals import Stepper
from formation_env.evaluation.rollout import Policy, evaluate
from formation_env.kernel.threads import usable_cpus
from formation_env.task.loading import load_scenario
from formation_env.task.members import members
from formation_env.task.scenario import Scenario

ROWS: Final = (1024, 4096, 65_536)
"""Batches that are measured."""
SWARM: Final = "swap"
SWARM_GROUPS: Final = 512
NONLINEAR: Final = "keeping_nonlinear"
_SMALL_THRUST: Final = 1e-3
"""Share of the full thrust with which hardly an episode ends before its plan does."""
_STEPS: Final = 300
"""Steps of a timed call, fewer than those of a plan."""
_ROW_STEPS: Final = 4_000_000
"""Steps of all rows together, which a timed call may not exceed."""
_SINGLE_STEPS: Final = 3000
_EPISODES: Final = 1000
_ROUNDS: Final = 6


class Case(NamedTuple):
    """What is measured.

    Attributes:
        name: as the table shows it.
        run: steps ours.
        reference: name of what it is held against.
        run_reference: steps that.
    """

    name: str
    run: Stepper
    reference: str
    run_reference: Stepper


class Line(NamedTuple):
    """A line of the table.

    Attributes:
        case: what was measured.
        ns_per_step: its time per step and row.
        reference: what it is held against.
        ratio: how many times as fast as that it is.
    """

    case: str
    ns_per_step: float
    reference: str
    ratio: float


def ratios(env: str, policy: Policy, scenario: Scenario, rounds: int = _ROUNDS) -> Iterator[Line]:
    """Measure all cases, one after the other.

    Args:
        env: name of the scenario, or a registered id.
        policy: a policy for it, which an evaluation flies.
        scenario: the scenario.
        rounds: in each of them ours and the reference take turns; the best of either counts.

    Yields:
        A line for each case.
    """
    for make in _cases(env, policy, scenario):
        case = make()
        best = rates({"ours": case.run, "reference": case.run_reference}, rounds)
        yield Line(case.name, 1e9 / best["ours"], case.reference, best["ours"] / best["reference"])


def _swarm_case(num_threads: int | None) -> Case:
    """Groups of followers beside as many followers alone."""
    scenario = load_scenario(SWARM)
    rows = SWARM_GROUPS * scenario.followers
    threads = "" if num_threads is None else ", 1 thread"
    return Case(
        f"{SWARM}, {SWARM_GROUPS} groups of {scenario.followers}{threads}",
        batch_stepper(SWARM, rows, _STEPS, _SMALL_THRUST, num_threads),
        f"one follower of it, {rows} rows",
        batch_stepper(members(scenario)[0][0], rows, _STEPS, _SMALL_THRUST, num_threads),
    )


def _cases(env: str, policy: Policy, scenario: Scenario) -> Iterator[Callable[[], Case]]:
    """What makes each case, when its turn has come: large batches shall not all be in memory."""
    for num_threads in (1, 2) if len(usable_cpus()) > 1 else (1,):
        for rows in ROWS:
            yield partial(_from_the_start, env, rows, num_threads)
    yield partial(_in_flight, env, ROWS[1], scenario.num_steps)
    yield partial(_from_the_start, NONLINEAR, ROWS[1], 1)
    yield partial(_swarm_case, 1)
    yield partial(_swarm_case, None)
    yield lambda: Case(
        "a single environment", single_stepper(env, _SINGLE_STEPS), REFERENCE, single_stepper(REFERENCE, _SINGLE_STEPS)
    )
    yield lambda: Case(
        f"evaluation of {_EPISODES} episodes",
        lambda: int(evaluate(policy, scenario, range(_EPISODES))["steps"].sum()),
        "the bare step",
        batch_stepper(env, _EPISODES, _STEPS, _SMALL_THRUST, num_threads=1, begins=True),
    )


def _from_the_start(env: str, rows: int, num_threads: int) -> Case:
    """A batch from the start on, with so little thrust that no episode ends, beside CartPole's of as many rows."""
    steps = min(_ROW_STEPS // rows, _STEPS)
    threads = "1 thread" if num_threads == 1 else f"{num_threads} threads"
    return Case(
        f"{rows} rows, {'nonlinear truth' if env == NONLINEAR else 'small thrust'}, {threads}",
        batch_stepper(env, rows, steps, _SMALL_THRUST, num_threads, begins=True),
        f"{REFERENCE}, {rows} rows",
        batch_stepper(REFERENCE, rows, steps),
    )


def _in_flight(env: str, rows: int, num_steps: int) -> Case:
    """A batch under full random thrust whose episodes end and begin at different times, beside CartPole's."""
    steps = _ROW_STEPS // rows
    run = batch_stepper(env, rows, steps, num_threads=1)
    for _ in range(-(-num_steps // steps)):
        run()
    name = f"{rows} rows, full thrust, 1 thread"
    return Case(name, run, f"{REFERENCE}, {rows} rows", batch_stepper(REFERENCE, rows, steps))
