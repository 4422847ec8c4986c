"""The compiled step and reset over all tiles."""

from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.files import hash_sources
from formation_env.kernel import packing, unpacking, variants
from formation_env.kernel import tile as field
from formation_env.kernel.stages import kalman_filter, memory, noise, observe, reward, start, thruster, true_motion
from formation_env.kernel.tile import Width
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, compiled_loop

Float32 = NDArray[np.float32]

_RESET_BLOCK: Final = 3  # a reset draws from blocks of its own, so that its first measurement is drawn like any other


class Program(NamedTuple):
    """The compiled functions for a kind of true motion and of the filter's model.

    Arguments that they share:
        states: the rows' states (tiles, STATE_FIELDS * LANES), updated.
        tile: scratch space for one tile (TILE_FIELDS * LANES,).
        schedule: each variant's plan and varying models (variants, steps, columns), `packing.step_table`.
        packed: each variant's settings (variants, SIZE), `packing.pack`.
        observations: (rows, SIZE), written.
        results: (NUM_RESULTS, tiles * LANES), written.
        width: see `tile.Width`.

    Attributes:
        step: fly all rows over one step, under actions (rows, 3).
        reset: start the next episode of the rows `rows` (k,), side by side in scratch space, from `starts`: states
            (k, 6) to start at exactly if `given`, else each variant's nominal start (variants, 6).
        redraw: draw the standard normals (NUM_NORMALS, tiles * LANES) of the last step or reset again.
    """

    step: Any
    reset: Any
    redraw: Any


@cache
def program(truth_kind: int, filter_kind: int, varied: bool) -> Program:
    """The compiled functions for kinds of true motion and of the filter's model (see `packing`).

    Args:
        truth_kind: kind of the true motion.
        filter_kind: kind of the filter's model.
        varied: whether rows fly different variants (see `variants`).
    """
    sources = _source_hash()
    return Program(_step(sources, truth_kind, filter_kind, varied), _reset(sources, varied), _redraw(sources))


# numba's cache looks only at the file of the outermost function; `source_hash`, a closure variable and so part of the
# cache's key, makes it see the others too. A closure may hold numbers only, since functions are new in each process.
# That is why a stage that depends on a kind is chosen by `if` on closure variables: numba drops the other branches
# before it types them. The choice must stand in the outermost function.


# Long: the choice of stages must stand in the outermost function, see above.
def _step(source_hash: int, truth_kind: int, filter_kind: int, varied: bool) -> Any:
    """Compile the step of all rows."""
    behind_filter_model = field.TABLE + (unpacking.FILTER_SIZE * LANES if filter_kind == packing.TIME_VARYING else 0)
    constant_truth, constant_filter = truth_kind == packing.TIME_INVARIANT, filter_kind == packing.TIME_INVARIANT
    # Rows of different variants have models of their own, as rows at different steps have where models vary.
    one_truth, one_filter_model = constant_truth and not varied, constant_filter and not varied
    true_table = variants.TRUTH if constant_truth else behind_filter_model
    filter_table = variants.FILTER if constant_filter else field.TABLE
    far = truth_kind == packing.NONLINEAR_FAR
    nonlinear = far or truth_kind == packing.NONLINEAR_NEAR

    @compiled_loop
    def step(
        states: Array,
        tile: Array,
        schedule: Array,
        packed: Array,
        actions: Float32,
        observations: Float32,
        results: Array,
        width: Width,
    ) -> int:
        """Fly all rows over one step; the arguments are those of `Program`."""
        if varied:
            true_dynamics, model, process, sensor, forces, settings = variants.nothing_shared()
        else:
            true_dynamics, model, process, sensor, forces, settings = unpacking.unpack(packed[0])
        known_step = -1
        for index in range(len(states)):
            used = min(len(width), len(actions) - index * LANES)
            memory.load(tile, width, states, index, actions, used)
            if varied:
                variants.load(tile, width, schedule, packed)
            else:
                known_step = memory.read_plan(tile, width, used, schedule[0], known_step)
            noise.draw(tile, width, 0)
            thruster.thrust(tile, width, settings)
            if one_truth:
                true_motion.fly_linear(tile, width, true_dynamics, settings)
            elif nonlinear:
                true_motion.fly_nonlinear(tile, width, true_table, far, forces, settings)
            else:
                true_motion.fly_varying(tile, width, true_table, settings)
            if one_filter_model:
                kalman_filter.predict(tile, width, model, process, settings)
            else:
                kalman_filter.predict_varying(tile, width, filter_table, settings)
            kalman_filter.measure(tile, width, sensor, settings)
            reward.score(tile, width, settings)
            observe.observe(tile, width, settings)
            memory.store(tile, width, states, index, observations, results, used)
        return source_hash

    return step


def _reset(source_hash: int, varied: bool) -> Any:
    """Compile the reset of some rows."""

    @compiled_loop
    def reset(
        states: Array,
        tile: Array,
        schedule: Array,
        packed: Array,
        rows: NDArray[np.intp],
        starts: Array,
        given: bool,
        observations: Float32,
        results: Array,
        width: Width,
    ) -> int:
        """Start the next episode of some rows; the arguments are those of `Program`."""
        if varied:
            _, _, _, sensor, _, settings = variants.nothing_shared()
        else:
            _, _, _, sensor, _, settings = unpacking.unpack(packed[0])
        for first in range(0, len(rows), len(width)):
            memory.gather(tile, width, states, rows, first)
            if varied:
                variants.load(tile, width, schedule, packed)
            else:
                memory.read_plan(tile, width, len(width), schedule[0], -1)
            start.place(tile, width, starts, given, first)
            noise.draw(tile, width, _RESET_BLOCK)
            start.begin(tile, width, given, settings)
            noise.draw(tile, width, 0)
            kalman_filter.measure(tile, width, sensor, settings)
            reward.score(tile, width, settings)
            observe.observe(tile, width, settings)
            memory.scatter(tile, width, states, rows, first, observations, results)
        return source_hash

    return reset


def _redraw(source_hash: int) -> Any:
    """Compile the repeated draw of the last step's random numbers."""

    @compiled_loop
    def redraw(states: Array, tile: Array, normals: Array, width: Width) -> int:
        """Draw all rows' standard normals again; the arguments are those of `Program`."""
        for index in range(len(states)):
            memory.load_streams(tile, width, states, index)
            noise.draw(tile, width, 0)
            memory.store_normals(tile, width, normals, index)
        return source_hash

    return redraw


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


def _source_hash() -> int:
    """Hash of all source files that the compiled code comes from."""
    package = Path(__file__).parents[1]
    paths = sorted(path for pattern in COMPILED_SOURCES for path in package.glob(pattern))
    return int(hash_sources(paths)[:14], 16)  # 56 bits: numba knows integers of 64
