"""Copies from a tile to the arrays outside: results and observations, and the state of rows that begin."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.settings import scalars
from formation_env.kernel.stages.plan import eight_from
from formation_env.kernel.tile import (
    FLAGS,
    INTEGERS,
    NOISES,
    NUM_NOISES,
    NUM_SAFETY,
    RESULTS,
    SHOWN,
    STATE,
    STATE_SIZE,
    WORK,
    WORK32,
    State,
    Work,
    plan,
)
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, tile_function, turns
from formation_env.numerics.streaming import LINE_BYTES, read_ahead, write_line
from formation_env.numerics.transpose import BLOCK, transpose_block
from formation_env.task.observation import SIZE

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]

LARGE_TILES: Final = 256
"""Tiles from which on the memory of a step is larger than the cache that a processor core has for itself."""
LINE_NUMBERS: Final = LINE_BYTES // 8
NUM_STATE: Final = sum(State())
PHASE: Final = plan("phase")
MEASURED, TERMINATED, TRUNCATED = FLAGS
FROM_STATE: Final = RESULTS.thrust
FROM_WORK: Final = RESULTS.reward + 1 - FROM_STATE
TO_NOISE: Final = Work().measurement + Work().innovation


@tile_function
def write_observations(work32: Array32, observations: Array32, first: int, n: int) -> None:
    """Write a tile's observations as lines of (rows, SIZE) from row `first` on."""
    flat = observations.reshape(-1)
    whole = n - n % BLOCK
    for i in range(0, whole, BLOCK):
        for begin in range(0, SIZE, BLOCK):
            k = min(begin, SIZE - BLOCK)
            starts = eight_from(WORK32.observation + k * LANES + i, LANES)
            transpose_block(work32, starts, flat, eight_from((first + i) * SIZE + k, SIZE))
    for i in range(whole, n):
        for k in range(SIZE):
            flat[(first + i) * SIZE + k] = work32[WORK32.observation + k * LANES + i]


@tile_function
def is_large(states: Array, results: Array) -> bool:
    """Whether the rows are so many that their memory is read and written in sweeps, see `streaming`."""
    return len(states) >= LARGE_TILES and results.ctypes.data % LINE_BYTES == 0 and results.shape[1] % LINE_NUMBERS == 0


@tile_function
def read_state(state: Array) -> None:
    """Bring a tile's state into the cache in one sweep; the stages touch it in an order that no processor foresees."""
    for k in range(0, STATE_SIZE, LINE_NUMBERS):
        read_ahead(state, k)


@tile_function
def stream_fields(tile: Array, offset: int, size: int, block: Array, place: int, first: int) -> None:
    """Copy consecutive fields of a whole tile into the columns of a block from `first` on, past the cache."""
    flat, pitch = block.reshape(-1), block.shape[1]
    for k in range(turns(size, tile)):
        for i in range(0, LANES, LINE_NUMBERS):
            write_line(tile, offset + k * LANES + i, flat, (place + k) * pitch + first + i)


@tile_function
def write_results(
    state: Array, work: Array, results: Array, flags: Flags, integers: Integers, first: int, n: int, large: bool
) -> int:
    """Write a tile's results in the columns from `first` on; return how many episodes ended."""
    if large and n == LANES:
        stream_fields(state, STATE.true_state, FROM_STATE, results, 0, first)
        stream_fields(work, WORK.thrust, FROM_WORK, results, FROM_STATE, first)
    else:
        for k in range(turns(FROM_STATE, state)):
            line = results[k, first:]  # from here on, so that the compiler sees that no index is negative
            for i in range(min(n, LANES)):
                line[i] = state[STATE.true_state + k * LANES + i]
        for k in range(turns(FROM_WORK, work)):
            line = results[FROM_STATE + k, first:]
            for i in range(min(n, LANES)):
                line[i] = work[WORK.thrust + k * LANES + i]
    measured, terminated, truncated = flags[MEASURED, first:], flags[TERMINATED, first:], flags[TRUNCATED, first:]
    phase, variant = integers[INTEGERS.phase, first:], integers[INTEGERS.variant, first:]
    for i in range(min(n, LANES)):
        measured[i] = state[STATE.measured + i] > 0.5
    for i in range(min(n, LANES)):
        phase[i] = np.int64(work[PHASE + i])
    for i in range(min(n, LANES)):
        variant[i] = np.int64(state[STATE.variant + i])
    for i in range(min(n, LANES)):
        terminated[i] = work[WORK.terminated + i] > 0.5
    for i in range(min(n, LANES)):
        truncated[i] = work[WORK.truncated + i] > 0.5
    ended = 0
    for i in range(min(n, LANES)):
        ended += int((work[WORK.terminated + i] > 0.5) | (work[WORK.truncated + i] > 0.5))
    return ended


@tile_function
def write_safety(work: Array, safety: Array, first: int, n: int) -> None:
    """Write what a step tells of safety, in the columns from `first` on."""
    for k in range(turns(NUM_SAFETY, work)):
        line = safety[k, first:]
        for i in range(min(n, LANES)):
            line[i] = work[WORK.cost + k * LANES + i]


@tile_function
def scatter_safety(work: Array, safety: Array, rows: NDArray[np.intp], first: int, n: int) -> None:
    """Write what is told of safety for rows that begin."""
    for i in range(n):
        for k in range(NUM_SAFETY):
            safety[k, rows[first + i]] = work[WORK.cost + k * LANES + i]


@tile_function
def write_noises(work: Array, work32: Array32, settings: Array, noises: Array, first: int, n: int) -> None:
    """Write what those who ask see of the random numbers, in the columns from `first` on."""
    for k in range(TO_NOISE):
        for i in range(n):
            noises[NOISES.measurement + k, first + i] = work[WORK.measurement + k * LANES + i]
    for k in range(3):
        for i in range(n):
            noises[NOISES.process_noise + k, first + i] = (
                work[WORK.push + k * LANES + i] - work[WORK.thrust + k * LANES + i]
            )
    for i in range(n):
        noises[NOISES.thrust_noise, first + i] = scalars(settings, i).thrust_noise * work32[WORK32.thrust_noise + i]


@tile_function
def scatter_state(
    spare: Array,
    spare_stream: NDArray[np.uint32],
    states: Array,
    streams: NDArray[np.uint32],
    rows: NDArray[np.intp],
    first: int,
    n: int,
) -> None:
    """Put rows that begin, side by side in a spare tile, in their places."""
    for i in range(n):
        index, lane = rows[first + i] // LANES, rows[first + i] % LANES
        for k in range(NUM_STATE):
            states[index, k * LANES + lane] = spare[k * LANES + i]
        for k in range(4):
            streams[index, k * LANES + lane] = spare_stream[k * LANES + i]


@tile_function
def scatter_observations(work32: Array32, observations: Array32, rows: NDArray[np.intp], first: int, n: int) -> None:
    """Write the observations of rows that begin."""
    for i in range(n):
        for k in range(SIZE):
            observations[rows[first + i], k] = work32[WORK32.observation + k * LANES + i]


@tile_function
def scatter_results(
    spare: Array,
    work: Array,
    results: Array,
    flags: Flags,
    integers: Integers,
    rows: NDArray[np.intp],
    first: int,
    n: int,
) -> None:
    """Write what is shown of rows that begin; reward and ends stay those of the step before."""
    for i in range(n):
        row = rows[first + i]
        for k in range(FROM_STATE):
            results[k, row] = spare[STATE.true_state + k * LANES + i]
        for k in range(FROM_STATE, SHOWN):
            results[k, row] = work[WORK.thrust + (k - FROM_STATE) * LANES + i]
        flags[MEASURED, row] = spare[STATE.measured + i] > 0.5
        integers[INTEGERS.phase, row] = np.int64(work[PHASE + i])
        integers[INTEGERS.variant, row] = np.int64(spare[STATE.variant + i])


@tile_function
def scatter_noises(work: Array, noises: Array, rows: NDArray[np.intp], first: int, n: int) -> None:
    """Write the measurement and the innovation of rows that begin; there was no thrust."""
    for i in range(n):
        for k in range(NUM_NOISES):
            noises[k, rows[first + i]] = work[WORK.measurement + k * LANES + i] if k < TO_NOISE else 0.0
