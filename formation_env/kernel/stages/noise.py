"""Random numbers of a step: normals and a uniform of each row's own stream."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.tile import WORK32
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

Stream = NDArray[np.uint32]

STREAM_SIZE: Final = 4 * LANES
NORMAL_PAIRS: Final = 5
NORMALS: Final = WORK32.process_noise  # and those of the sensor and the thrust behind them
_LOW: Final = np.uint64(0xFFFFFFFF)
_SHIFT: Final = np.uint64(32)


@inline_scalar
def _next_word(stream: Stream, i: int) -> np.uint32:
    word, (s0, s1, s2, s3) = random_streams.next_word(
        stream[i], stream[LANES + i], stream[2 * LANES + i], stream[3 * LANES + i]
    )
    stream[i], stream[LANES + i], stream[2 * LANES + i], stream[3 * LANES + i] = s0, s1, s2, s3
    return word


@tile_function
def draw(stream: Stream, work32: Array32, n: int) -> None:
    """Draw the random numbers of an instant from the rows' streams."""
    for pair in range(NORMAL_PAIRS):
        first = NORMALS + 2 * pair * LANES
        for i in range(min(n, LANES)):
            a = _next_word(stream, i)
            b = _next_word(stream, i)
            work32[first + i], work32[first + LANES + i] = random_streams.normal_pair(a, b)
    for i in range(min(n, LANES)):
        work32[WORK32.link_noise + i] = random_streams.uniform(_next_word(stream, i))


@tile_function
def begin_streams(stream: Stream, keys: NDArray[np.uint64], rows: NDArray[np.intp], first: int, n: int) -> None:
    """Set the streams for the rows' next episodes; a row of `keys` is its key (2) and the number of its episode."""
    for i in range(n):
        key = keys[rows[first + i]]
        a, b = random_streams.threefry2x64(key[0], key[1], np.uint64(0), key[2])
        stream[i], stream[LANES + i] = np.uint32(a & _LOW), np.uint32(a >> _SHIFT)
        stream[2 * LANES + i], stream[3 * LANES + i] = np.uint32(b & _LOW), np.uint32(b >> _SHIFT)
        key[2] += np.uint64(1)
