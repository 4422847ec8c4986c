"""Random numbers of a step: uniforms and normals of each row's own stream."""

from typing import Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.tile import Width
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import to_bits, to_integer
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

NUM_NORMALS: Final = 10
"""Standard normals drawn at an instant."""
PROCESS_NORMALS: Final = slice(0, 3)
SENSOR_NORMALS: Final = slice(3, 9)
THRUST_NORMAL: Final = 9
"""Normals that disturb the acceleration, the measurement and the thrust's magnitude."""
FIRST_PROCESS_NOISE: Final = field.NORMAL
FIRST_SENSOR_NOISE: Final = field.NORMAL + 3 * LANES
THRUST_NOISE: Final = field.NORMAL + THRUST_NORMAL * LANES
LINK_UNIFORM: Final = field.UNIFORM + NUM_NORMALS * LANES


@inline_scalar
def draw_uniforms(tile: Array, i: int, block: int, first_block: int) -> None:
    """Four uniforms of the row's stream: block 0, 1, 2 of the twelve."""
    counter = to_integer(random_streams.BLOCKS_PER_STEP * tile[field.STEP + i]) + np.uint64(first_block + block)
    a, b = random_streams.threefry2x64(
        to_bits(tile[field.KEY + i]), to_bits(tile[field.KEY + LANES + i]), counter, to_integer(tile[field.EPISODE + i])
    )
    u = field.UNIFORM + 4 * block * LANES + i
    tile[u], tile[u + LANES] = random_streams.uniform_pair(a)
    tile[u + 2 * LANES], tile[u + 3 * LANES] = random_streams.uniform_pair(b)


@inline_scalar
def draw_normals(tile: Array, i: int, pair: int) -> None:
    """Two standard normals from two uniforms: pair 0 to 4."""
    u, v = field.UNIFORM + 2 * pair * LANES + i, field.NORMAL + 2 * pair * LANES + i
    tile[v], tile[v + LANES] = random_streams.normal_pair(tile[u], tile[u + LANES])


@tile_function
def draw(tile: Array, width: Width, first_block: int) -> None:
    """Draw the random numbers of an instant from the rows' streams."""
    for block in range(3):
        for i in range(len(width)):
            draw_uniforms(tile, i, block, first_block)
    for pair in range(5):
        for i in range(len(width)):
            draw_normals(tile, i, pair)
