"""The compiled step and reset over all tiles."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from formation_env.dynamics.base import Array
from formation_env.jit import FAST_MATH, LANES
from formation_env.kernel import packing, stages, truth, variants
from formation_env.kernel import tile as f
from formation_env.kernel.tile import LaneSet

_RESET_BLOCK = 3  # a reset draws from blocks of its own, so that its first measurement is drawn like any other


class Program(NamedTuple):
    """The compiled functions for a kind of true motion and of the filter's model."""

    step: Any
    reset: Any


@cache
def program(truth_kind: int, belief_kind: int, varied: bool) -> Program:
    """The compiled step and reset for kinds of true motion and of the filter's model (see `packing`).

    Args:
        truth_kind: of the true motion.
        belief_kind: of the filter's model.
        varied: whether rows fly different variants (see `variants`).
    """
    return _compile(_source_hash(), truth_kind, belief_kind, varied)


def _compile(source_hash: int, truth_kind: int, belief_kind: int, varied: bool) -> Program:
    """Compile step and reset.

    numba's cache looks only at the file of the outermost function; the hash, which is part of the cache's key, makes it
    see the others too. So is what else step and reset take from here: numbers, since functions are new in each process.
    """
    behind_belief = f.TABLE + (packing.BELIEF_SIZE * LANES if belief_kind == packing.VARYING_MODEL else 0)
    constant_truth, constant_belief = truth_kind == packing.CONSTANT_MODEL, belief_kind == packing.CONSTANT_MODEL
    # Rows of different variants have models of their own, as rows at different steps have where models vary.
    one_truth, one_belief = constant_truth and not varied, constant_belief and not varied
    true_table = variants.TRUTH if constant_truth else behind_belief
    belief_table = variants.BELIEF if constant_belief else f.TABLE
    nonlinear = truth_kind in (packing.NONLINEAR_NEAR, packing.NONLINEAR_FAR)
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
            schedule: of each variant the plan and what differs from step to step, `packing.step_table`.
            settings: of each variant, packed.
            actions: (rows, 3).
            observations: (rows, SIZE), written.
            results: (NUM_RESULTS, tiles * LANES), written.
            lane_set: as long as the rows used of each tile.
        """
        if varied:
            true_model, model, process, sensor, forces, c = variants.nothing_shared()
        else:
            true_model, model, process, sensor, forces, c = packing.unpack(settings[0])
        known_step = -1
        for tile in range(len(states)):
            used = min(len(lane_set), len(actions) - tile * LANES)
            stages.load(t, lane_set, states, tile, actions, used)
            if varied:
                variants.draw(t, lane_set, len(settings))
                variants.read(t, lane_set, schedule, settings)
            else:
                known_step = stages.read_plan(t, lane_set, used, schedule[0], known_step)
            stages.draw(t, lane_set, 0)
            stages.thrust(t, lane_set, c)
            if one_truth:
                truth.fly_linear(t, lane_set, true_model, c)
            elif nonlinear:
                truth.fly_nonlinear(t, lane_set, true_table, truth_kind == packing.NONLINEAR_FAR, forces, c)
            else:
                truth.fly_varying(t, lane_set, true_table, c)
            if one_belief:
                stages.predict(t, lane_set, model, process, c)
            else:
                stages.predict_varying(t, lane_set, belief_table, c)
            stages.measure(t, lane_set, sensor, c)
            stages.judge(t, lane_set, c)
            stages.observe(t, lane_set, c)
            stages.store(t, lane_set, states, tile, observations, results, used)
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
            starts: states (k, 6) to start at, or those (variants, 6) to start about.
            given: whether the rows start just there, not about it.
            observations: written in these rows.
            results: written in these rows.
            lane_set: as in `step`.
        """
        if varied:
            _, _, _, sensor, _, c = variants.nothing_shared()
        else:
            _, _, _, sensor, _, c = packing.unpack(settings[0])
        for first in range(0, len(rows), len(lane_set)):
            stages.gather(t, lane_set, states, rows, first)
            if varied:
                variants.draw(t, lane_set, len(settings))
                variants.read(t, lane_set, schedule, settings)
            else:
                stages.read_plan(t, lane_set, len(lane_set), schedule[0], -1)
            stages.place(t, lane_set, starts, given, first)
            stages.draw(t, lane_set, _RESET_BLOCK)
            stages.begin(t, lane_set, given, c)
            stages.draw(t, lane_set, 0)
            stages.measure(t, lane_set, sensor, c)
            stages.judge(t, lane_set, c)
            stages.observe(t, lane_set, c)
            stages.scatter(t, lane_set, states, rows, first, observations, results)
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
