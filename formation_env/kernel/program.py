"""The compiled step and reset over all tiles."""

import hashlib
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.dynamics.base import Array
from formation_env.jit import FAST_MATH, LANES, stage
from formation_env.kernel import lanes, packing
from formation_env.kernel import tile as f
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
def _move(t: Array, lane_set: LaneSet, truth: packing.Model, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.thruster(t, i, c)
    for i in range(len(lane_set)):
        lanes.truth_dynamics(t, i, truth, c)
    for i in range(len(lane_set)):
        lanes.link(t, i, c)


@stage
def _predict(t: Array, lane_set: LaneSet, believed: packing.Model, belief: packing.Belief) -> None:
    for i in range(len(lane_set)):
        lanes.filter_time_update(t, i, believed, belief)


@stage
def _measure(t: Array, lane_set: LaneSet, belief: packing.Belief, c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.dropout(t, i, c)
    for i in range(len(lane_set)):
        lanes.filter_measurement_update(t, i, belief, c)


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
def _begin(t: Array, lane_set: LaneSet, given: NDArray[np.bool_], c: packing.Scalars) -> None:
    for i in range(len(lane_set)):
        lanes.begin(t, i, given[i], c)


@stage
def _read_plan(t: Array, lane_set: LaneSet, schedule: Array, known_step: int) -> int:
    """The schedule's rows. Mostly all rows are at one step, which the scratch space may hold already.

    Args:
        t: the tile.
        lane_set: as long as the rows used of the tile.
        schedule: the table.
        known_step: the step whose row the whole tile holds, or -1.

    Returns:
        The same, after this call.
    """
    last = len(schedule) - 1
    first = min(int(t[f.STEP]), last)
    same = True
    for i in range(1, len(lane_set)):
        same &= t[f.STEP + i] == t[f.STEP]
    if same and first == known_step:
        return first
    for k in range(WIDTH):
        for i in range(len(lane_set)):
            step = first if same else min(int(t[f.STEP + i]), last)
            t[f.PLAN + k * LANES + i] = schedule[step, k]
    return first if same else -1


def _compile(source_hash: int) -> tuple[Any, Any]:
    """Compile step and reset.

    numba's cache looks only at the file of the outermost function; the hash, which is part of the cache's key, makes it
    see the others too.
    """
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
            schedule: the plan (num_steps + 1, WIDTH).
            settings: packed settings.
            actions: (rows, 3).
            observations: (rows, SIZE), written.
            results: (NUM_RESULTS, tiles * LANES), written.
            lane_set: as long as the rows used of each tile.
        """
        truth, believed, belief, c = packing.unpack(settings)
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
            known_step = _read_plan(t, lane_set, schedule, known_step)
            _draw(t, lane_set, 0)
            _move(t, lane_set, truth, c)
            _predict(t, lane_set, believed, belief)
            _measure(t, lane_set, belief, c)
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
        chosen: NDArray[np.bool_],
        given: NDArray[np.bool_],
        starts: Array,
        observations: NDArray[np.float32],
        results: Array,
        lane_set: LaneSet,
    ) -> int:
        """Start the next episode of some rows. A whole tile is begun in scratch space, and what was chosen is kept.

        Args:
            states: as in `step`.
            t: as in `step`.
            schedule: as in `step`.
            settings: as in `step`.
            chosen: rows to begin (tiles * LANES,).
            given: rows that start just at their start, not about it (tiles * LANES,).
            starts: states to start at (tiles * LANES, 6).
            observations: written in the rows chosen.
            results: written in the rows chosen.
            lane_set: as in `step`.
        """
        _, _, belief, c = packing.unpack(settings)
        for tile in range(len(states)):
            first = tile * LANES
            if not chosen[first : first + LANES].any():
                continue
            for k in range(_STATE_SIZE):
                t[k] = states[tile, k]
            for i in range(len(lane_set)):
                t[f.STEP + i] = 0.0
                t[f.EPISODE + i] += 1.0
                for k in range(6):
                    t[f.TRUTH + k * LANES + i] = starts[first + i, k]
            _read_plan(t, lane_set, schedule, -1)
            _draw(t, lane_set, _RESET_BLOCK)
            _begin(t, lane_set, given[first : first + LANES], c)
            _draw(t, lane_set, 0)
            _measure(t, lane_set, belief, c)
            _judge(t, lane_set, c)
            _observe(t, lane_set, c)
            for i in range(len(lane_set)):
                if chosen[first + i]:
                    if first + i < len(observations):
                        for k in range(SIZE):
                            observations[first + i, k] = np.float32(t[f.OBSERVATION + k * LANES + i])
                    for k in range(f.STATE_FIELDS):
                        states[tile, k * LANES + i] = t[k * LANES + i]
                    for k in range(f.NUM_RESULTS):
                        results[k, first + i] = t[f.RESULTS + k * LANES + i]
        return source_hash

    return step, reset


# Files whose functions or constants are compiled into the program, beside those of this folder.
COMPILED_MODULES = ("jit", "fastmath", "streams", "estimation", "observation", "schedule")


def _source_hash() -> int:
    """A number that changes with any source file that the compiled code comes from."""
    package = Path(__file__).parents[1]
    paths = sorted([*package.glob("kernel/*.py"), *(package / f"{name}.py" for name in COMPILED_MODULES)])
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in paths))
    return int.from_bytes(digest.digest()[:7])


step, reset = _compile(_source_hash())
