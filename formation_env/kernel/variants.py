"""Rows that fly different variants of a scenario.

Settings that all rows share are tuples of scalars, known outside the loop over the rows. With variants they are None
there, and each row has its own in the tile: which of the two is a question of types, so settled when compiling.
"""

from typing import Any, Final

import numpy as np

from formation_env.kernel import packing
from formation_env.kernel import tile as field
from formation_env.kernel.packing import Forces, Scalars, SensorNoise
from formation_env.kernel.tile import Width
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import to_bits, to_integer
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.task.schedule import WIDTH

TRUTH: Final = field.SETTINGS
"""Where the tile has the rows' true models, if they do not vary from step to step."""
FILTER: Final = field.SETTINGS + packing.FILTER * LANES
"""The same for the filter's model and process noise."""
_COUNTER: Final = np.uint64(6)  # behind the blocks of a step and of a reset, in what would be the numbers of step 0


@inline_scalar
def nothing_shared() -> Any:
    """In place of `packing.unpack`: nothing that all rows share."""
    return None, None, None, None, None, None


@inline_scalar
def own_scalars(tile: Array, i: int, shared: Scalars | None) -> Scalars:
    """The numbers of row i's settings."""
    if shared is None:
        return packing.unpack_scalars(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def own_sensor(tile: Array, i: int, shared: SensorNoise | None) -> SensorNoise:
    """The sensor that row i's filter believes in."""
    if shared is None:
        return packing.unpack_sensor(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def own_forces(tile: Array, i: int, shared: Forces | None) -> Forces:
    """What acts on row i in the nonlinear truth."""
    if shared is None:
        return packing.unpack_forces(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def _draw(tile: Array, i: int, count: int) -> None:
    """Row i's variant, by its stream and episode: the same at all steps, of numbers that are used for nothing else."""
    word, _ = random_streams.threefry2x64(
        to_bits(tile[field.KEY + i]),
        to_bits(tile[field.KEY + LANES + i]),
        _COUNTER,
        to_integer(tile[field.EPISODE + i]),
    )
    uniform, _ = random_streams.uniform_pair(word)
    tile[field.VARIANT + i] = np.floor(uniform * count)


@tile_function
def draw(tile: Array, width: Width, count: int) -> None:
    """Which of `count` variants the rows fly."""
    for i in range(len(width)):
        _draw(tile, i, count)


@inline_scalar
def column(k: int) -> int:
    """Where a column of the schedule stands in the tile."""
    return field.PLAN + k * LANES if k < WIDTH else field.TABLE + (k - WIDTH) * LANES


@tile_function
def read(tile: Array, width: Width, schedule: Array, packed: Array) -> None:
    """The settings of the rows' variants, and their rows of the schedule.

    Args:
        tile: the tile, in which the variants have been drawn.
        width: as long as the lanes computed.
        schedule: tables of all variants (variants, steps, columns).
        packed: packed settings of all variants (variants, SIZE).
    """
    _, steps, columns = schedule.shape
    own, now = np.empty(LANES, np.intp), np.empty(LANES, np.intp)
    for i in range(len(width)):
        variant = int(tile[field.VARIANT + i])
        own[i] = variant * packing.SIZE
        now[i] = (variant * steps + min(int(tile[field.STEP + i]), steps - 1)) * columns
    numbers, plans = packed.reshape(-1), schedule.reshape(-1)
    for k in range(packing.SIZE):
        for i in range(len(width)):
            tile[field.SETTINGS + k * LANES + i] = numbers[own[i] + k]
    for k in range(columns):
        for i in range(len(width)):
            tile[column(k) + i] = plans[now[i] + k]
