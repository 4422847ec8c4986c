"""The compiled step and reset over all tiles."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import packing, variants
from formation_env.kernel import tile as field
from formation_env.kernel.stages import kalman_filter, memory, noise, observe, reward, start, thruster, true_motion
from formation_env.kernel.tile import Width
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import FAST_MATH, LANES

_RESET_BLOCK = 3  # a reset draws from blocks of its own, so that its first measurement is drawn like any other


class Program(NamedTuple):
    """The compiled functions for a kind of true motion and of the filter's model."""

    step: Any
    reset: Any


@cache
def program(truth_kind: int, filter_kind: int, varied: bool) -> Program:
    """The compiled step and reset for kinds of true motion and of the filter's model (see `packing`).

    Args:
        truth_kind: of the true motion.
        filter_kind: of the filter's model.
        varied: whether rows fly different variants (see `variants`).
    """
    return _compile(_source_hash(), truth_kind, filter_kind, varied)


def _compile(source_hash: int, truth_kind: int, filter_kind: int, varied: bool) -> Program:
    """Compile step and reset.

    numba's cache looks only at the file of the outermost function; the hash, which is part of the cache's key, makes it
    see the others too. So is what else step and reset take from here: numbers, since functions are new in each process.
    """
    behind_filter_model = field.TABLE + (packing.FILTER_SIZE * LANES if filter_kind == packing.TIME_VARYING else 0)
    constant_truth, constant_filter = truth_kind == packing.TIME_INVARIANT, filter_kind == packing.TIME_INVARIANT
    # Rows of different variants have models of their own, as rows at different steps have where models vary.
    one_truth, one_filter_model = constant_truth and not varied, constant_filter and not varied
    true_table = variants.TRUTH if constant_truth else behind_filter_model
    filter_table = variants.FILTER if constant_filter else field.TABLE
    nonlinear = truth_kind in (packing.NONLINEAR_NEAR, packing.NONLINEAR_FAR)
    compiled = numba.njit(cache=True, fastmath=FAST_MATH, error_model="numpy")

    @compiled
    def step(
        states: Array,
        tile: Array,
        schedule: Array,
        packed: Array,
        actions: NDArray[np.float32],
        observations: NDArray[np.float32],
        results: Array,
        width: Width,
    ) -> int:
        """One step of all rows.

        Args:
            states: the rows' states (tiles, STATE_FIELDS * LANES), updated.
            tile: scratch space for one tile (TILE_FIELDS * LANES,).
            schedule: of each variant the plan and what differs from step to step, `packing.step_table`.
            packed: of each variant, packed.
            actions: (rows, 3).
            observations: (rows, SIZE), written.
            results: (NUM_RESULTS, tiles * LANES), written.
            width: as long as the rows used of each tile.
        """
        if varied:
            true_dynamics, model, process, sensor, forces, settings = variants.nothing_shared()
        else:
            true_dynamics, model, process, sensor, forces, settings = packing.unpack(packed[0])
        known_step = -1
        for index in range(len(states)):
            used = min(len(width), len(actions) - index * LANES)
            memory.load(tile, width, states, index, actions, used)
            if varied:
                variants.draw(tile, width, len(packed))
                variants.read(tile, width, schedule, packed)
            else:
                known_step = memory.read_plan(tile, width, used, schedule[0], known_step)
            noise.draw(tile, width, 0)
            thruster.thrust(tile, width, settings)
            if one_truth:
                true_motion.fly_linear(tile, width, true_dynamics, settings)
            elif nonlinear:
                true_motion.fly_nonlinear(
                    tile, width, true_table, truth_kind == packing.NONLINEAR_FAR, forces, settings
                )
            else:
                true_motion.fly_varying(tile, width, true_table, settings)
            if one_filter_model:
                kalman_filter.predict(tile, width, model, process, settings)
            else:
                kalman_filter.predict_varying(tile, width, filter_table, settings)
            kalman_filter.measure(tile, width, sensor, settings)
            reward.judge(tile, width, settings)
            observe.observe(tile, width, settings)
            memory.store(tile, width, states, index, observations, results, used)
        return source_hash

    @compiled
    def reset(
        states: Array,
        tile: Array,
        schedule: Array,
        packed: Array,
        rows: NDArray[np.intp],
        starts: Array,
        given: bool,
        observations: NDArray[np.float32],
        results: Array,
        width: Width,
    ) -> int:
        """Start the next episode of some rows, which are put side by side in scratch space.

        Args:
            states: as in `step`.
            tile: as in `step`.
            schedule: as in `step`.
            packed: as in `step`.
            rows: which rows (k,).
            starts: states (k, 6) to start at, or those (variants, 6) to start about.
            given: whether the rows start just there, not about it.
            observations: written in these rows.
            results: written in these rows.
            width: as in `step`.
        """
        if varied:
            _, _, _, sensor, _, settings = variants.nothing_shared()
        else:
            _, _, _, sensor, _, settings = packing.unpack(packed[0])
        for first in range(0, len(rows), len(width)):
            memory.gather(tile, width, states, rows, first)
            if varied:
                variants.draw(tile, width, len(packed))
                variants.read(tile, width, schedule, packed)
            else:
                memory.read_plan(tile, width, len(width), schedule[0], -1)
            start.place(tile, width, starts, given, first)
            noise.draw(tile, width, _RESET_BLOCK)
            start.begin(tile, width, given, settings)
            noise.draw(tile, width, 0)
            kalman_filter.measure(tile, width, sensor, settings)
            reward.judge(tile, width, settings)
            observe.observe(tile, width, settings)
            memory.scatter(tile, width, states, rows, first, observations, results)
        return source_hash

    return Program(step, reset)


# Sources whose functions or constants are compiled into the program.
COMPILED_SOURCES = (
    "kernel/**/*.py",
    "numerics/*.py",
    "orbital/constants.py",
    "orbital/accelerations.py",
    "dynamics/nonlinear.py",
    "task/observation.py",
    "task/schedule.py",
)


def _source_hash() -> int:
    """A number that changes with any source file that the compiled code comes from."""
    package = Path(__file__).parents[1]
    paths = sorted(path for pattern in COMPILED_SOURCES for path in package.glob(pattern))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in paths))
    return int.from_bytes(digest.digest()[:7])
