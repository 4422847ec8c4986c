"""Time of each stage of the step, called alone in a compiled loop over the tiles of a simulation in flight."""

import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple, cast

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import variants
from formation_env.kernel.program import Kinds, kinds_of, new_scratch, stages_of
from formation_env.kernel.simulation import Simulation
from formation_env.kernel.stages import closest_approach, link, memory, noise, observe, plan, reward
from formation_env.kernel.stages.memory import Flags, Integers
from formation_env.kernel.stages.true_motion import push
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES
from formation_env.task.scenario import Scenario

WHOLE: Final = "whole step"
_ROUNDS: Final = 7
_ROWS_PER_CALL: Final = 16_384
"""A small batch is passed over again and again in one timed call."""
_MAX_PASSES: Final = 64
"""So few that no stage, repeated without the others, leaves the range of numbers it was written for."""

_Call = Callable[..., object]


class _Arrays(NamedTuple):
    """What the stages read and write, see `program.Program`; `known_line` (1,) is carried from tile to tile."""

    states: Array
    streams: NDArray[np.uint32]
    work: Array
    work32: Array32
    own: Array
    schedule: Array
    seen: Array32
    packed: Array
    numbers: Array
    actions: Array32
    observations: Array32
    results: Array
    flags: Flags
    integers: Integers
    safety: Array
    known_line: NDArray[np.intp]


def stage_times(scenario: Scenario, rows: int, rounds: int = _ROUNDS) -> dict[str, float]:
    """Time per row of each stage in the order of the step, and of the whole step called from Python.

    The state is restored before each call. The time of a call that does nothing is subtracted from that of a stage.

    Args:
        scenario: the scenario; its kinds choose the stages.
        rows: rows of the batch.
        rounds: calls of each stage, of which the fastest counts.

    Returns:
        ns per row of each stage, and of `WHOLE`.
    """
    simulation, arrays = _in_flight(scenario, rows)
    kinds = kinds_of(scenario, len(simulation.variants))
    before = simulation.memory()
    passes = min(max(_ROWS_PER_CALL // rows, 1), _MAX_PASSES)

    def seconds(run: Callable[[int], object]) -> float:
        run(1)  # compiles
        best = np.inf
        for _ in range(rounds):
            simulation.recall(before)
            arrays.known_line[0] = -1
            start = time.perf_counter()
            run(passes)
            best = min(best, time.perf_counter() - start)
        return best

    def alone(call: _Call) -> float:
        loop = _loop(call)
        return seconds(lambda count: loop(arrays, count))

    nothing = alone(_nothing)
    times = {name: max(alone(call) - nothing, 0.0) for name, call in _calls(kinds).items()}
    arguments = simulation.arguments(arrays.observations)
    times[WHOLE] = seconds(lambda count: [simulation.fly(arguments) for _ in range(count)])
    return {name: taken / (passes * rows) * 1e9 for name, taken in times.items()}


def _in_flight(scenario: Scenario, rows: int) -> tuple[Simulation, _Arrays]:
    """A simulation that has been reset and stepped with random actions, and its arrays."""
    generator = np.random.default_rng(0)
    simulation = Simulation(scenario, rows)
    for row, source in enumerate(generator.spawn(rows)):
        simulation.seed(row, source)
    observations = simulation.new_observations()
    simulation.reset(np.arange(rows), observations)
    simulation.actions[:] = generator.uniform(-1, 1, simulation.actions.shape)
    simulation.step(observations)
    states, streams, schedule, seen, packed = simulation._arrays
    work, work32, own = cast(Any, new_scratch).py_func(schedule, len(simulation.variants) > 1)
    results, flags, integers, safety, _ = simulation.results.blocks
    numbers = own if len(own) else packed
    known_line = np.full(1, -1, np.intp)
    inputs = (states, streams, work, work32, own, schedule, seen, packed, numbers, simulation.actions)
    return simulation, _Arrays(*inputs, observations, results, flags, integers, safety, known_line)


def _loop(call: _Call) -> Any:
    """Compile a loop of a stage over all tiles."""
    stage = numba.njit(error_model="numpy", forceinline=True)(call)

    @numba.njit(error_model="numpy")
    def loop(arrays: _Arrays, passes: int) -> None:
        for _ in range(passes):
            for index in range(len(arrays.states)):
                row = index * LANES
                n = min(LANES, len(arrays.actions) - row)
                stage(arrays, arrays.states[index], arrays.streams[index], row, n)

    return loop


def _nothing(arrays: _Arrays, state: Array, stream: noise.Stream, row: int, n: int) -> None:
    """The call of no stage."""


def _name(stage: Any) -> str:
    """Name of a stage behind that of its module."""
    function = getattr(stage, "py_func", stage)
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


# Long: a line or two for each stage, and the order of the stages is best read at one place.
def _calls(kinds: Kinds) -> dict[str, _Call]:
    """A call of each stage in the order of `program._step`: (arrays, state, stream, row, n), n rows from `row` on."""
    thrust, move, predict, sense, measure, table = stages_of(kinds)

    def read_plan(a: _Arrays, state: Array, stream: noise.Stream, row: int, n: int) -> None:
        a.known_line[0] = plan.read_plan(state, a.work, a.work32, a.schedule, a.seen, a.known_line[0], n)

    calls: dict[str, _Call] = {"plan.advance": lambda a, state, stream, row, n: plan.advance(state, n)}
    if kinds.varied:
        calls["variants.read_settings"] = lambda a, state, stream, row, n: variants.read_settings(
            state, a.packed, a.own, n
        )
    calls["plan.read_plan"] = read_plan
    calls["noise.draw"] = lambda a, state, stream, row, n: noise.draw(stream, a.work32, n)
    calls[_name(thrust)] = lambda a, state, stream, row, n: thrust(a.actions, row, a.work, a.work32, a.numbers, n)
    calls["link.change"] = lambda a, state, stream, row, n: link.change(state, a.work32, a.numbers, n)
    calls["true_motion.push"] = lambda a, state, stream, row, n: push(a.work, a.work32, a.numbers, n)
    if kinds.guarded:
        calls["closest_approach.remember"] = lambda a, state, stream, row, n: closest_approach.remember(
            state, a.work, n
        )
    calls[_name(move)] = lambda a, state, stream, row, n: move(state, a.work, a.numbers, table, n)
    calls[_name(predict)] = lambda a, state, stream, row, n: predict(state, a.work, a.numbers, n)
    calls["link.receive"] = lambda a, state, stream, row, n: link.receive(state, a.work, a.numbers, n)
    calls[_name(sense)] = lambda a, state, stream, row, n: sense(state, a.work, a.work32, a.numbers, n)
    calls[_name(measure)] = lambda a, state, stream, row, n: measure(state, a.work, a.numbers, n)
    if kinds.guarded:
        calls["closest_approach.approach_leader"] = lambda a, state, stream, row, n: closest_approach.approach_leader(
            state, a.work, a.numbers, n
        )
        calls["closest_approach.end_approach"] = lambda a, state, stream, row, n: closest_approach.end_approach(
            a.work, n
        )
        calls["reward.check_safety"] = lambda a, state, stream, row, n: reward.check_safety(state, a.work, a.numbers, n)
        calls["memory.write_safety"] = lambda a, state, stream, row, n: memory.write_safety(a.work, a.safety, row, n)
    else:
        calls["reward.check_distance"] = lambda a, state, stream, row, n: reward.check_distance(
            state, a.work, a.numbers, n
        )
    calls["reward.score"] = lambda a, state, stream, row, n: reward.score(state, a.work, a.numbers, n)
    calls["observe.observe"] = lambda a, state, stream, row, n: observe.observe(state, a.work, a.work32, n)
    calls["memory.write_observations"] = lambda a, state, stream, row, n: memory.write_observations(
        a.work32, a.observations, row, n
    )
    calls["memory.write_results"] = lambda a, state, stream, row, n: memory.write_results(
        state, a.work, a.results, a.flags, a.integers, row, n, memory.is_large(a.states, a.results)
    )
    return calls
