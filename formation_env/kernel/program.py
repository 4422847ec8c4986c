"""The compiled step and reset: a composition of stages, chosen by kinds."""

from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from formation_env.files import hash_sources
from formation_env.kernel import packing, settings, variants
from formation_env.kernel.stages import (
    closest_approach,
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
from formation_env.kernel.tile import MODELS, STATE_SIZE, WORK32_SIZE, WORK_SIZE
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, compiled_program, entry_point, inline_scalar
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import WIDTH

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
        guarded: whether the scenario limits anything that costs, see `scenario.Safety`.
    """

    truth: str
    filter_model: str
    sensor: str
    thruster: str
    varied: bool
    guarded: bool


class Program(NamedTuple):
    """The compiled functions for some kinds.

    Arguments that they share:
        states, streams: what the rows carry (tiles, STATE_SIZE) and (tiles, STREAM_SIZE), updated.
        keys: of the rows' random numbers, with the number of the next episode (rows, 3).
        schedule, seen, packed: what the scenario's variants need, `packing.pack_variants`.
        observations: (rows, SIZE), written.
        results, flags, integers, safety, noises: blocks (fields, rows), written; see `results.block_shapes`.

    Attributes:
        step: fly the rows of the tiles from first to last - 1 over one step, under actions (rows, 3); returns how many
            episodes ended. Threads may step different tiles at once.
        reset: start the next episode of the rows `rows` (k,) from `starts`: states (k, 6) to start at exactly if
            `given`, else each variant's nominal start (variants, 6).
    """

    step: Any
    reset: Any


_BLOCK, _BLOCK32 = types.float64[:, ::1], types.float32[:, ::1]
TYPES: Final = {
    "states": _BLOCK,
    "streams": types.uint32[:, ::1],
    "keys": types.uint64[:, ::1],
    "schedule": types.float64[:, :, ::1],
    "seen": types.float32[:, :, ::1],
    "packed": _BLOCK,
    "first": types.intp,
    "last": types.intp,
    "rows": types.intp[::1],
    "starts": _BLOCK,
    "given": types.boolean,
    "actions": _BLOCK32,
    "observations": _BLOCK32,
    "results": _BLOCK,
    "flags": types.boolean[:, ::1],
    "integers": types.int64[:, ::1],
    "safety": _BLOCK,
    "noises": _BLOCK,
}
"""The types of the arguments of a program, by name; all arrays are C-contiguous."""


def is_guarded(scenario: Scenario) -> bool:
    """Whether anything but the distance from the reference is limited."""
    safe = scenario.safety
    return max(scenario.limits.keep_out_m, safe.min_distance_m, safe.collision_distance_m, safe.max_error_m) > 0.0


def kinds_of(scenario: Scenario, num_variants: int) -> Kinds:
    """The kinds that a scenario needs."""
    return Kinds(
        truth=packing.truth_kind(scenario),
        filter_model=packing.filter_kind(scenario),
        sensor=scenario.sensor.measures,
        thruster="ideal",
        varied=num_variants > 1,
        guarded=is_guarded(scenario),
    )


@cache
def program(kinds: Kinds) -> Program:
    """The compiled functions for some kinds; they are compiled here, or read from the cache on disk."""
    return Program(*(entry_point(function, TYPES) for function in dispatchers(kinds)))


@cache
def look() -> Any:
    """The compiled function that writes the observations of all rows again; the arguments are those of `Program`."""
    return entry_point(look_dispatcher(), TYPES)


@cache
def dispatchers(kinds: Kinds) -> Program:
    """The functions of `program` as numba holds them, with what it knows of its cache."""
    sources = source_hash()
    return Program(_step(kinds, sources), _reset(kinds, sources))


@inline_scalar
def new_scratch(schedule: Array, varied: bool) -> tuple[Array, Array32, Array]:
    """Scratch space for a tile: double, single, and the settings of the rows' variants."""
    width = WORK_SIZE + (schedule.shape[2] - WIDTH) * LANES
    return np.empty(width), np.empty(WORK32_SIZE, np.float32), np.empty(settings.SIZE * LANES if varied else 0)


class Stages(NamedTuple):
    """The compiled stages that kinds choose.

    Attributes:
        thrust, move, predict, sense, measure: see the registries that `Kinds` names.
        table: place of the leader's table of a true motion that needs one, counted in numbers.
    """

    thrust: Any
    move: Any
    predict: Any
    sense: Any
    measure: Any
    table: int


def stages_of(kinds: Kinds) -> Stages:
    """The stages of some kinds."""
    return Stages(
        thrust=thruster.KINDS[kinds.thruster],
        move=MOTIONS[kinds.truth],
        predict=kalman_filter.PREDICT[kinds.filter_model],
        sense=sensor.KINDS[kinds.sensor],
        measure=kalman_filter.MEASURE[kinds.sensor],
        table=MODELS + (settings.FILTER_SIZE if kinds.filter_model == packing.VARYING else 0),
    )


# Long: numba takes the arrays one by one, and the order of the stages is best read at one place.
def _step(kinds: Kinds, sources: str) -> Any:
    """Compile the step."""
    thrust, move, predict, sense, measure, table = stages_of(kinds)
    varied, guarded = kinds.varied, kinds.guarded

    # Long: see above.
    @compiled_program("step", kinds, sources)
    def step(
        states: Array,
        streams: Streams,
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
        safety: Array,
        noises: Array,
    ) -> int:
        """Fly rows over one step; the arguments are those of `Program`."""
        work, work32, own = new_scratch(schedule, varied)
        large = memory.is_large(states, results)
        ended, known_line = 0, -1
        for index in range(first, last):
            state, row = states[index], index * LANES
            n = min(LANES, len(actions) - row)
            if large:
                memory.read_state(state)
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
            if guarded:
                closest_approach.remember(state, work, n)
            move(state, work, numbers, table, n)
            predict(state, work, numbers, n)
            link.receive(state, work, numbers, n)
            sense(state, work, work32, numbers, n)
            if len(noises):
                kalman_filter.innovate(state, work, n)
                memory.write_noises(work, work32, numbers, noises, row, n)
            measure(state, work, numbers, n)
            if guarded:
                closest_approach.approach_leader(state, work, numbers, n)
                closest_approach.end_approach(work, n)
                reward.check_safety(state, work, numbers, n)
                memory.write_safety(work, safety, row, n)
            else:
                reward.check_distance(state, work, numbers, n)
            reward.score(state, work, numbers, n)
            observe.observe(state, work, work32, n)
            memory.write_observations(work32, observations, row, n)
            ended += memory.write_results(state, work, results, flags, integers, row, n, large)
        return ended

    return step


# Long: see `_step`.
def _reset(kinds: Kinds, sources: str) -> Any:
    """Compile the reset of some rows."""
    _, _, _, sense, measure, _ = stages_of(kinds)
    varied, guarded = kinds.varied, kinds.guarded

    @compiled_program("reset", kinds, sources)
    def reset(
        states: Array,
        streams: Streams,
        keys: NDArray[np.uint64],
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
        safety: Array,
        noises: Array,
    ) -> None:
        """Start the next episode of some rows, side by side in a spare tile; the arguments are those of `Program`."""
        work, work32, own = new_scratch(schedule, varied)
        spare, spare_stream = np.empty(STATE_SIZE), np.empty(noise.STREAM_SIZE, np.uint32)
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
            if guarded:
                closest_approach.remember(spare, work, n)
                closest_approach.approach_leader(spare, work, numbers, n)
                closest_approach.end_approach(work, n)
                reward.check_safety(spare, work, numbers, n)
                memory.scatter_safety(work, safety, rows, first, n)
            else:
                reward.check_distance(spare, work, numbers, n)
            reward.score(spare, work, numbers, n)
            observe.observe(spare, work, work32, n)
            memory.scatter_state(spare, spare_stream, states, streams, rows, first, n)
            memory.scatter_results(spare, work, results, flags, integers, rows, first, n)
            memory.scatter_observations(work32, observations, rows, first, n)

    return reset


@cache
def look_dispatcher() -> Any:
    """The function of `look` as numba holds it."""

    @compiled_program("look", source_hash())
    def look(states: Array, schedule: Array, seen: Array32, observations: Array32) -> None:
        """Write the observations of all rows; the arguments are those of `Program`."""
        work, work32, _ = new_scratch(schedule, False)
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


def source_hash() -> str:
    """Hash of all source files that the compiled code comes from."""
    package = Path(__file__).parents[1]
    return hash_sources(sorted(path for pattern in COMPILED_SOURCES for path in package.glob(pattern)))
