"""The compiled step and reset over all tiles."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.dynamics.base import Array
from formation_env.jit import FAST_MATH, LANES, stage
from formation_env.kernel import filter, lanes, packing, truth
from formation_env.kernel import tile as f
from formation_env.kernel.linear import read_model, read_process
from formation_env.observation import SIZE
from formation_env.schedule import WIDTH

LaneSet = tuple[bool, ...]

_STATE_SIZE = f.STATE_FIELDS * LANES
_RESET_BLOCK = 3  # a reset draws from blocks of its own, so that its first measurement is drawn like any other


# The stages over one tile. Each is a function of its own, since the compiler loses its grip on larger ones. The length
# of the tuple `lane_set` says how many of the tile's rows are used: it is part of a type, so known when compiling. A
# batch uses all LANES, a single environment one.


@stage
def _draw(t: Array, lane_set: LaneSet, first_block: int) -> None:
    for block in range(3):
        for i in range(len(lane_set)):
            lanes.draw_uniforms(t, i, block, first_block)
    for pair in range(5):
        for i in range(len(lane_set)):
            lanes.draw_normals(t, i, pair)


@stage
def _thrust(t: Array, lane_set: LaneSet, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.thruster(t, i, c)
    for i in range(len(lane_set)):
        lanes.link(t, i, c)


@stage
def _predict(
    t: Array, lane_set: LaneSet, model: packing.Model, noise: packing.ProcessNoise, c: packing.Scalars
) -> None:
    for i in range(len(lane_set)):
        filter.filter_time_update(t, i, model, noise, c)


@stage
def _predict_varying(t: Array, lane_set: LaneSet, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        filter.filter_time_update(t, i, read_model(t, i, f.TABLE), read_process(t, i, f.TABLE), c)


@stage
def _measure(t: Array, lane_set: LaneSet, sensor: packing.SensorNoise, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.dropout(t, i, c)
    for i in range(len(lane_set)):
        filter.filter_measurement_update(t, i, sensor, c)


@stage
def _judge(t: Array, lane_set: LaneSet, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.reward_and_end(t, i, c)
    for i in range(len(lane_set)):
        lanes.totals(t, i, c)


@stage
def _observe(t: Array, lane_set: LaneSet, c: packing.Scalars) -> None:
    for axis in range(6):
        for i in range(len(lane_set)):
            lanes.observe_error(t, i, axis, c)
    for i in range(len(lane_set)):
        lanes.observe_arrival(t, i, c)
    for i in range(len(lane_set)):
        lanes.observe_rest(t, i, c)


@stage
def _begin(t: Array, lane_set: LaneSet, given: bool, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.begin(t, i, given, c)


@stage
def _read_plan(t: Array, lane_set: LaneSet, used: int, schedule: Array, known_step: int) -> int:
    """The schedule's rows. Mostly all rows are at one step, which the scratch space may hold already.

    Args:
        t: the tile.
        lane_set: as long as the lanes computed.
        used: how many of them are rows; the others do not matter.
        schedule: the table.
        known_step: the step whose row the whole tile holds, or -1.

    Returns:
        The same, after this call.
    """
    last = len(schedule) - 1
    first = min(int(t[f.STEP]), last)
    same = True
    for i in range(1, used):
        same &= t[f.STEP + i] == t[f.STEP]
    if same and first == known_step:
        return first
    for k in range(schedule.shape[1]):
        field = f.PLAN + k * LANES if k < WIDTH else f.TABLE + (k - WIDTH) * LANES
        if same:
            value = schedule[first, k]
            for i in range(len(lane_set)):
                t[field + i] = value
        else:
            for i in range(len(lane_set)):
                t[field + i] = schedule[min(int(t[f.STEP + i]), last), k]
    return first if same else -1


class Program(NamedTuple):
    """The compiled functions for a kind of true motion and of the filter's model."""

    step: Any
    reset: Any


@cache
def program(truth_kind: int, belief_kind: int) -> Program:
    """The compiled step and reset for kinds of true motion and of the filter's model (see `packing`)."""
    return _compile(_source_hash(), truth_kind, belief_kind)


def _compile(source_hash: int, truth_kind: int, belief_kind: int) -> Program:
    """Compile step and reset.

    numba's cache looks only at the file of the outermost function; the hash, which is part of the cache's key, makes it
    see the others too.
    """
    table = f.TABLE + (packing.BELIEF_SIZE * LANES if belief_kind == packing.VARYING_MODEL else 0)
    compiled = numba.njit(cache=True, fastmath=FAST_MATH, error_model="numpy")

    @compiled
    def step(
        states: Array,
        t: Array,
        schedule: Array,
        settings: Array,
        actions: NDArray[np.float32],
        observations: NDArray[np.float32],
        results: Array,
        lane_set: LaneSet,
    ) -> int:
        """One step of all rows.

        Args:
            states: the rows' states (tiles, STATE_FIELDS * LANES), updated.
            t: scratch space for one tile (TILE_FIELDS * LANES,).
            schedule: the plan and what varies behind it, `packing.step_table`.
            settings: packed settings.
            actions: (rows, 3).
            observations: (rows, SIZE), written.
            results: (NUM_RESULTS, tiles * LANES), written.
            lane_set: as long as the rows used of each tile.
        """
        true_model, model, process, sensor, forces, c = packing.unpack(settings)
        rows = len(actions)
        known_step = -1
        for tile in range(len(states)):
            first = tile * LANES
            used = min(len(lane_set), rows - first)
            for k in range(_STATE_SIZE):
                t[k] = states[tile, k]
            for i in range(used):
                for k in range(3):
                    t[f.ACTION + k * LANES + i] = actions[first + i, k]
            for i in range(len(lane_set)):
                t[f.STEP + i] += 1.0
            known_step = _read_plan(t, lane_set, used, schedule, known_step)
            _draw(t, lane_set, 0)
            _thrust(t, lane_set, c)
            if truth_kind == packing.CONSTANT_MODEL:
                truth.fly_linear(t, lane_set, true_model, c)
            elif truth_kind == packing.VARYING_MODEL:
                truth.fly_varying(t, lane_set, table, c)
            else:
                truth.fly_nonlinear(t, lane_set, table, truth_kind == packing.NONLINEAR_FAR, forces, c)
            if belief_kind == packing.CONSTANT_MODEL:
                _predict(t, lane_set, model, process, c)
            else:
                _predict_varying(t, lane_set, c)
            _measure(t, lane_set, sensor, c)
            _judge(t, lane_set, c)
            _observe(t, lane_set, c)
            for k in range(_STATE_SIZE):
                states[tile, k] = t[k]
            for i in range(used):
                for k in range(SIZE):
                    observations[first + i, k] = np.float32(t[f.OBSERVATION + k * LANES + i])
            for k in range(f.NUM_RESULTS):
                for i in range(len(lane_set)):
                    results[k, first + i] = t[f.RESULTS + k * LANES + i]
        return source_hash

    @compiled
    def reset(
        states: Array,
        t: Array,
        schedule: Array,
        settings: Array,
        rows: NDArray[np.intp],
        starts: Array,
        given: bool,
        observations: NDArray[np.float32],
        results: Array,
        lane_set: LaneSet,
    ) -> int:
        """Start the next episode of some rows, which are put side by side in scratch space.

        Args:
            states: as in `step`.
            t: as in `step`.
            schedule: as in `step`.
            settings: as in `step`.
            rows: which rows (k,).
            starts: states to start at (k, 6).
            given: whether the rows start just there, not about it.
            observations: written in these rows.
            results: written in these rows.
            lane_set: as in `step`.
        """
        _, _, _, sensor, _, c = packing.unpack(settings)
        for first in range(0, len(rows), len(lane_set)):
            for i in range(len(lane_set)):
                source = min(first + i, len(rows) - 1)  # idle lanes repeat the last row
                tile, lane = rows[source] // LANES, rows[source] % LANES
                for k in range(f.STATE_FIELDS):
                    t[k * LANES + i] = states[tile, k * LANES + lane]
                for k in range(6):
                    t[f.TRUTH + k * LANES + i] = starts[source, k]
                t[f.STEP + i] = 0.0
                t[f.EPISODE + i] += 1.0
            _read_plan(t, lane_set, len(lane_set), schedule, -1)
            _draw(t, lane_set, _RESET_BLOCK)
            _begin(t, lane_set, given, c)
            _draw(t, lane_set, 0)
            _measure(t, lane_set, sensor, c)
            _judge(t, lane_set, c)
            _observe(t, lane_set, c)
            for i in range(min(len(lane_set), len(rows) - first)):
                row = rows[first + i]
                for k in range(f.STATE_FIELDS):
                    states[row // LANES, k * LANES + row % LANES] = t[k * LANES + i]
                for k in range(SIZE):
                    observations[row, k] = np.float32(t[f.OBSERVATION + k * LANES + i])
                for k in range(f.NUM_RESULTS):
                    results[k, row] = t[f.RESULTS + k * LANES + i]
        return source_hash

    return Program(step, reset)


# Files whose functions or constants are compiled into the program, beside those of this folder.
COMPILED_MODULES = (
    "jit",
    "constants",
    "fastmath",
    "forces",
    "streams",
    "estimation",
    "observation",
    "schedule",
    "dynamics/nonlinear",
)


def _source_hash() -> int:
    """A number that changes with any source file that the compiled code comes from."""
    package = Path(__file__).parents[1]
    paths = sorted([*package.glob("kernel/*.py"), *(package / f"{name}.py" for name in COMPILED_MODULES)])
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in paths))
    return int.from_bytes(digest.digest()[:7])
