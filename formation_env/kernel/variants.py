"""Rows that fly different variants of a scenario.

Settings that all rows share are tuples of scalars, known outside the loop over the rows. With variants they are None,
and each row has its own in the tile; numba specialises on the type, so there is no run-time branch.
"""

from typing import Any, Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel import unpacking
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Forces, Scalars, SensorNoise
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import to_bits, to_integer
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.task.schedule import WIDTH

TRUTH: Final = field.SETTINGS
"""Offset of the rows' true models in the tile, if they are time-invariant."""
FILTER: Final = field.SETTINGS + unpacking.FILTER * LANES
"""Offset of the filter's models and process noises, if they are time-invariant."""
_COUNTER: Final = np.uint64(6)  # the first block of step 0 that neither a step nor a reset uses


@inline_scalar
def nothing_shared() -> Any:
    """Stand in for `unpacking.unpack` where no settings are shared by all rows."""
    return None, None, None, None, None, None


@inline_scalar
def own_scalars(tile: Array, i: int, shared: Scalars | None) -> Scalars:
    """The numbers of row i's settings."""
    if shared is None:
        return unpacking.unpack_scalars(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def own_sensor(tile: Array, i: int, shared: SensorNoise | None) -> SensorNoise:
    """The filter's sensor model of row i."""
    if shared is None:
        return unpacking.unpack_sensor(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def own_forces(tile: Array, i: int, shared: Forces | None) -> Forces:
    """Forces on row i in the nonlinear truth."""
    if shared is None:
        return unpacking.unpack_forces(tile, field.SETTINGS + i, LANES)
    return shared


@inline_scalar
def _draw(tile: Array, i: int, count: int) -> None:
    """Draw row i's variant from its stream and episode: the same at all steps, from numbers used for nothing else."""
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
    """Draw which of `count` variants each row flies."""
    for i in range(len(width)):
        _draw(tile, i, count)


@inline_scalar
def column(k: int) -> int:
    """Offset of a column of the schedule in the tile."""
    return field.PLAN + k * LANES if k < WIDTH else field.TABLE + (k - WIDTH) * LANES


@tile_function
def read(tile: Array, width: Width, schedule: Array, packed: Array) -> None:
    """Load the settings of the rows' variants, and their rows of the schedule.

    Args:
        tile: the tile, in which the variants have been drawn.
        width: see `tile.Width`.
        schedule: tables of all variants (variants, steps, columns).
        packed: packed settings of all variants (variants, SIZE).
    """
    _, steps, columns = schedule.shape
    own, now = np.empty(LANES, np.intp), np.empty(LANES, np.intp)
    for i in range(len(width)):
        variant = int(tile[field.VARIANT + i])
        own[i] = variant * unpacking.SIZE
        now[i] = (variant * steps + min(int(tile[field.STEP + i]), steps - 1)) * columns
    numbers, plans = packed.reshape(-1), schedule.reshape(-1)
    for k in range(unpacking.SIZE):
        for i in range(len(width)):
            tile[field.SETTINGS + k * LANES + i] = numbers[own[i] + k]
    for k in range(columns):
        for i in range(len(width)):
            tile[column(k) + i] = plans[now[i] + k]


@tile_function
def load(tile: Array, width: Width, schedule: Array, packed: Array) -> None:
    """Draw the rows' variants, and load their settings and rows of the schedule."""
    draw(tile, width, len(packed))
    read(tile, width, schedule, packed)
