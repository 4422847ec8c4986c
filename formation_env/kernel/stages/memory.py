"""Copies between the rows' memory and a tile: states in, states and results out, and the row of the schedule."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import tile as field
from formation_env.kernel.stages.noise import NUM_NORMALS
from formation_env.kernel.tile import Width
from formation_env.kernel.variants import column
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, tile_function
from formation_env.task.observation import SIZE

STATE_SIZE: Final = field.STATE_FIELDS * LANES


@tile_function
def load(tile: Array, width: Width, states: Array, index: int, actions: NDArray[np.float32], used: int) -> None:
    """Load a tile's states and actions, and advance its step counters."""
    for k in range(STATE_SIZE):
        tile[k] = states[index, k]
    for i in range(used):
        for k in range(3):
            tile[field.ACTION + k * LANES + i] = actions[index * LANES + i, k]
    for i in range(len(width)):
        tile[field.STEP + i] += 1.0


@tile_function
def store(
    tile: Array,
    width: Width,
    states: Array,
    index: int,
    observations: NDArray[np.float32],
    results: Array,
    used: int,
) -> None:
    """Store a tile's states, observations and results."""
    first = index * LANES
    for k in range(STATE_SIZE):
        states[index, k] = tile[k]
    for i in range(used):
        for k in range(SIZE):
            observations[first + i, k] = np.float32(tile[field.OBSERVATION + k * LANES + i])
    for k in range(field.NUM_RESULTS):
        for i in range(len(width)):
            results[k, first + i] = tile[field.RESULTS + k * LANES + i]


@tile_function
def load_streams(tile: Array, width: Width, states: Array, index: int) -> None:
    """Load what the random numbers of a tile's last step come from: key, episode and step."""
    for k in range(field.TRUTH):
        tile[k] = states[index, k]


@tile_function
def store_normals(tile: Array, width: Width, normals: Array, index: int) -> None:
    """Store the standard normals of a tile's rows."""
    for k in range(NUM_NORMALS):
        for i in range(len(width)):
            normals[k, index * LANES + i] = tile[field.NORMAL + k * LANES + i]


@tile_function
def gather(tile: Array, width: Width, states: Array, rows: NDArray[np.intp], first: int) -> None:
    """Load the rows from `first` on side by side, and advance their episode counters."""
    for i in range(len(width)):
        source = min(first + i, len(rows) - 1)  # idle lanes repeat the last row
        index, lane = rows[source] // LANES, rows[source] % LANES
        for k in range(field.STATE_FIELDS):
            tile[k * LANES + i] = states[index, k * LANES + lane]
        tile[field.STEP + i] = 0.0
        tile[field.EPISODE + i] += 1.0


@tile_function
def scatter(
    tile: Array,
    width: Width,
    states: Array,
    rows: NDArray[np.intp],
    first: int,
    observations: NDArray[np.float32],
    results: Array,
) -> None:
    """Store the rows that `gather` loaded, with their observations and results."""
    for i in range(min(len(width), len(rows) - first)):
        row = rows[first + i]
        for k in range(field.STATE_FIELDS):
            states[row // LANES, k * LANES + row % LANES] = tile[k * LANES + i]
        for k in range(SIZE):
            observations[row, k] = np.float32(tile[field.OBSERVATION + k * LANES + i])
        for k in range(field.NUM_RESULTS):
            results[k, row] = tile[field.RESULTS + k * LANES + i]


@tile_function
def read_plan(tile: Array, width: Width, used: int, schedule: Array, known_step: int) -> int:
    """Load the schedule's row of each row's step; usually all are at one step, which the tile may hold already.

    Args:
        tile: the tile.
        width: see `tile.Width`.
        used: number of rows in the tile; the values of the idle ones do not matter.
        schedule: the table (steps, columns).
        known_step: the step whose row the whole tile holds, or -1.

    Returns:
        `known_step` after this call.
    """
    last = len(schedule) - 1
    first = min(int(tile[field.STEP]), last)
    same = True
    for i in range(1, used):
        same &= tile[field.STEP + i] == tile[field.STEP]
    if same and first == known_step:
        return first
    if same:
        for k in range(schedule.shape[1]):
            value = schedule[first, k]
            for i in range(len(width)):
                tile[column(k) + i] = value
        return first
    for i in range(len(width)):
        step = min(int(tile[field.STEP + i]), last)
        for k in range(schedule.shape[1]):
            tile[column(k) + i] = schedule[step, k]
    return -1
