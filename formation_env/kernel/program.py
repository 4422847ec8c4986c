"""The compiled step and reset: a composition of stages, chosen by kinds."""

from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.files import hash_sources
from formation_env.kernel import packing, settings, variants
from formation_env.kernel.stages import (
    kalman_filter,
    link,
    memory,
    noise,
    nonlinear_motion,
    observe,
    plan,
    reward,
    sensor,
    start,
    thruster,
    true_motion,
)
from formation_env.kernel.stages.memory import Flags, Integers
from formation_env.kernel.tile import MODELS
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, compiled_program
from formation_env.task.scenario import Scenario

Streams = NDArray[np.uint32]
Rows = NDArray[np.intp]

MOTIONS: Final = {
    "constant": true_motion.fly_constant,
    "varying": true_motion.fly_varying,
    "near": nonlinear_motion.fly_near,
    "far": nonlinear_motion.fly_far,
}
"""The compiled stage of each kind of true motion."""


class Kinds(NamedTuple):
    """What a program is composed of, by names in the stages' registries.

    Attributes:
        truth: of the true motion, in `MOTIONS`.
        filter_model: of the filter's model, in `kalman_filter.PREDICT`.
        sensor: in `sensor.KINDS` and `kalman_filter.MEASURE`.
        thruster: in `thruster.KINDS`.
        varied: whether rows fly different variants (see `variants`).
    """

    truth: str
    filter_model: str
    sensor: str
    thruster: str
    varied: bool


class Program(NamedTuple):
    """The compiled functions for some kinds.

    Arguments that they share:
        states, streams: what the rows carry (tiles, STATE_SIZE) and (tiles, STREAM_SIZE), updated.
        keys: of the rows' random numbers, with the number of the next episode (rows, 3).
        work, work32, own: scratch space; `own` for the settings of the rows' variants.
        schedule, seen, packed: what the scenario's variants need, `packing.pack_variants`.
        observations: (rows, SIZE), written.
        results, flags, integers, noises: blocks (fields, rows), written; no fields of `noises` if nobody asks.

    Attributes:
        step: fly the rows of the tiles from first to last - 1 over one step, under actions (rows, 3); returns how many
            episodes ended. Threads may step different tiles at once, each with scratch space of its own.
        reset: start the next episode of the rows `rows` (k,), side by side in a spare tile, from `starts`: states
            (k, 6) to start at exactly if `given`, else each variant's nominal start (variants, 6).
        look: write the observations of all rows again.
    """

    step: Any
    reset: Any
    look: Any


def kinds_of(scenario: Scenario, num_variants: int) -> Kinds:
    """The kinds that a scenario needs."""
    return Kinds(
        truth=packing.truth_kind(scenario),
        filter_model=packing.filter_kind(scenario),
        sensor=scenario.sensor.measures,
        thruster="ideal",
        varied=num_variants > 1,
    )


@cache
def program(kinds: Kinds) -> Program:
    """The compiled functions for some kinds."""
    sources = _source_hash()
    return Program(_step(kinds, sources), _reset(kinds, sources), _look(sources))


# Long: numba takes the arrays one by one, and the order of the stages is best read at one place.
def _step(kinds: Kinds, sources: str) -> Any:
    """Compile the step."""
    thrust, move = thruster.KINDS[kinds.thruster], MOTIONS[kinds.truth]
    predict = kalman_filter.PREDICT[kinds.filter_model]
    sense, measure = sensor.KINDS[kinds.sensor], kalman_filter.MEASURE[kinds.sensor]
    table = MODELS + (settings.FILTER_SIZE if kinds.filter_model == packing.VARYING else 0)
    varied = kinds.varied

    @compiled_program("step", kinds, sources)
    def step(
        states: Array,
        streams: Streams,
        work: Array,
        work32: Array32,
        own: Array,
        schedule: Array,
        seen: Array32,
        packed: Array,
        first: int,
        last: int,
        actions: Array32,
        observations: Array32,
        results: Array,
        flags: Flags,
        integers: Integers,
        noises: Array,
    ) -> int:
        """Fly rows over one step; the arguments are those of `Program`."""
        ended, known_line = 0, -1
        for index in range(first, last):
            state, row = states[index], index * LANES
            n = min(LANES, len(actions) - row)
            plan.advance(state, n)
            if varied:
                variants.read_settings(state, packed, own, n)
                numbers = own
            else:
                numbers = packed
            known_line = plan.read_plan(state, work, work32, schedule, seen, known_line, n)
            noise.draw(streams[index], work32, n)
            thrust(actions, row, work, work32, numbers, n)
            link.change(state, work32, numbers, n)
            true_motion.push(work, work32, numbers, n)
            move(state, work, numbers, table, n)
            predict(state, work, numbers, n)
            link.receive(state, work, numbers, n)
            sense(state, work, work32, numbers, n)
            if len(noises):
                kalman_filter.innovate(state, work, n)
                memory.write_noises(work, work32, numbers, noises, row, n)
            measure(state, work, numbers, n)
            reward.score(state, work, numbers, n)
            observe.observe(state, work, work32, n)
            memory.write_observations(work32, observations, row, n)
            ended += memory.write_results(state, work, results, flags, integers, row, n)
        return ended

    return step


# Long: see `_step`.
def _reset(kinds: Kinds, sources: str) -> Any:
    """Compile the reset of some rows."""
    sense, measure = sensor.KINDS[kinds.sensor], kalman_filter.MEASURE[kinds.sensor]
    varied = kinds.varied

    @compiled_program("reset", kinds, sources)
    def reset(
        states: Array,
        streams: Streams,
        keys: NDArray[np.uint64],
        spare: Array,
        spare_stream: NDArray[np.uint32],
        work: Array,
        work32: Array32,
        own: Array,
        schedule: Array,
        seen: Array32,
        packed: Array,
        rows: Rows,
        starts: Array,
        given: bool,
        observations: Array32,
        results: Array,
        flags: Flags,
        integers: Integers,
        noises: Array,
    ) -> None:
        """Start the next episode of some rows; the arguments are those of `Program`."""
        for first in range(0, len(rows), LANES):
            n = min(LANES, len(rows) - first)
            start.clear(spare, work)
            if varied:
                variants.draw(spare, keys, rows, first, len(packed), n)
                variants.read_settings(spare, packed, own, n)
                numbers = own
            else:
                numbers = packed
            plan.read_plan(spare, work, work32, schedule, seen, -1, n)
            noise.begin_streams(spare_stream, keys, rows, first, n)
            start.place(spare, starts, given, first, n)
            noise.draw(spare_stream, work32, n)
            start.begin(spare, work32, given, numbers, n)
            noise.draw(spare_stream, work32, n)
            link.receive(spare, work, numbers, n)
            sense(spare, work, work32, numbers, n)
            if len(noises):
                kalman_filter.innovate(spare, work, n)
                memory.scatter_noises(work, noises, rows, first, n)
            measure(spare, work, numbers, n)
            reward.score(spare, work, numbers, n)
            observe.observe(spare, work, work32, n)
            memory.scatter_state(spare, spare_stream, states, streams, rows, first, n)
            memory.scatter_results(spare, work, work32, observations, results, flags, integers, rows, first, n)

    return reset


def _look(sources: str) -> Any:
    """Compile the repetition of the observations."""

    @compiled_program("look", sources)
    def look(
        states: Array, work: Array, work32: Array32, schedule: Array, seen: Array32, observations: Array32
    ) -> None:
        """Write the observations of all rows; the arguments are those of `Program`."""
        for index in range(len(states)):
            state, row = states[index], index * LANES
            n = min(LANES, len(observations) - row)
            plan.read_plan(state, work, work32, schedule, seen, -1, n)
            observe.observe(state, work, work32, n)
            memory.write_observations(work32, observations, row, n)

    return look


COMPILED_SOURCES: Final = (
    "kernel/**/*.py",
    "numerics/*.py",
    "orbital/constants.py",
    "orbital/accelerations.py",
    "dynamics/nonlinear.py",
    "task/observation.py",
    "task/schedule.py",
)
"""Sources whose functions or constants are compiled into the program."""


def _source_hash() -> str:
    """Hash of all source files that the compiled code comes from."""
    package = Path(__file__).parents[1]
    return hash_sources(sorted(path for pattern in COMPILED_SOURCES for path in package.glob(pattern)))
