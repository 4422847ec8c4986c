"""Rows that fly different variants of a scenario.

Settings that all rows share are one line (1, SIZE). With variants each row has its own in scratch space,
(SIZE * LANES,); numba specialises on the type, so there is no run-time branch.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import settings
from formation_env.kernel.stages.plan import read_lines
from formation_env.kernel.tile import STATE
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, tile_function

_COUNTER: Final = np.uint64(1)  # 0 gives the stream of the episode
_SHIFT: Final = np.uint64(40)
_2_TO_MINUS_24: Final = 2.0**-24


@tile_function
def draw(state: Array, keys: NDArray[np.uint64], rows: NDArray[np.intp], first: int, count: int, n: int) -> None:
    """Draw which of `count` variants each row flies in its next episode, from numbers used for nothing else."""
    for i in range(n):
        key = keys[rows[first + i]]
        word, _ = random_streams.threefry2x64(key[0], key[1], _COUNTER, key[2])
        state[STATE.variant + i] = np.floor(np.int64(word >> _SHIFT) * _2_TO_MINUS_24 * count)


@tile_function
def read_settings(state: Array, packed: Array, own: Array, n: int) -> None:
    """Load the settings of the rows' variants.

    Args:
        state: the tile.
        packed: settings of all variants (variants, SIZE).
        own: scratch space (SIZE * LANES,).
        n: rows.
    """
    lines = np.empty(LANES, np.intp)
    for i in range(n):
        lines[i] = int(state[STATE.variant + i]) * settings.SIZE
    read_lines(packed.reshape(-1), 0, settings.SIZE, lines, own, 0, n)
