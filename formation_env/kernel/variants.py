"""Rows that fly different variants of a scenario.

Settings that all rows share are tuples of scalars, known outside the loop over the rows. With variants they are None
there, and each row has its own in the tile: which of the two is a question of types, so settled when compiling.
"""

from typing import Any, Final

import numpy as np

from formation_env import streams
from formation_env.dynamics.base import Array
from formation_env.fastmath import to_bits, to_integer
from formation_env.jit import LANES, lane, stage
from formation_env.kernel import packing
from formation_env.kernel import tile as f
from formation_env.kernel.packing import Forces, Scalars, SensorNoise
from formation_env.kernel.tile import LaneSet
from formation_env.schedule import WIDTH

TRUTH: Final = f.SETTINGS
"""Where the tile has the rows' true models, if they do not vary from step to step."""
BELIEF: Final = f.SETTINGS + packing.BELIEF * LANES
"""The same for the filter's model and process noise."""
_COUNTER: Final = np.uint64(6)  # behind the blocks of a step and of a reset, in what would be the numbers of step 0


@lane
def nothing_shared() -> Any:
    """In place of `packing.unpack`: nothing that all rows share."""
    return None, None, None, None, None, None


@lane
def own_scalars(t: Array, i: int, shared: Scalars | None) -> Scalars:
    """The numbers of row i's settings."""
    if shared is None:
        return packing.unpack_scalars(t, f.SETTINGS + i, LANES)
    return shared


@lane
def own_sensor(t: Array, i: int, shared: SensorNoise | None) -> SensorNoise:
    """The sensor that row i's filter believes in."""
    if shared is None:
        return packing.unpack_sensor(t, f.SETTINGS + i, LANES)
    return shared


@lane
def own_forces(t: Array, i: int, shared: Forces | None) -> Forces:
    """What acts on row i in the nonlinear truth."""
    if shared is None:
        return packing.unpack_forces(t, f.SETTINGS + i, LANES)
    return shared


@lane
def _draw(t: Array, i: int, count: int) -> None:
    """Row i's variant, by its stream and episode: the same at all steps, of numbers that are used for nothing else."""
    word, _ = streams.threefry2x64(
        to_bits(t[f.KEY + i]), to_bits(t[f.KEY + LANES + i]), _COUNTER, to_integer(t[f.EPISODE + i])
    )
    uniform, _ = streams.uniform_pair(word)
    t[f.VARIANT + i] = np.floor(uniform * count)


@stage
def draw(t: Array, lane_set: LaneSet, count: int) -> None:
    """Which of `count` variants the rows fly."""
    for i in range(len(lane_set)):
        _draw(t, i, count)


@lane
def column(k: int) -> int:
    """Where a column of the schedule stands in the tile."""
    return f.PLAN + k * LANES if k < WIDTH else f.TABLE + (k - WIDTH) * LANES


@stage
def read(t: Array, lane_set: LaneSet, schedule: Array, settings: Array) -> None:
    """The settings of the rows' variants, and their rows of the schedule.

    Args:
        t: the tile, in which the variants have been drawn.
        lane_set: as long as the lanes computed.
        schedule: tables of all variants (variants, steps, columns).
        settings: packed settings of all variants (variants, SIZE).
    """
    _, steps, columns = schedule.shape
    own, now = np.empty(LANES, np.intp), np.empty(LANES, np.intp)
    for i in range(len(lane_set)):
        variant = int(t[f.VARIANT + i])
        own[i] = variant * packing.SIZE
        now[i] = (variant * steps + min(int(t[f.STEP + i]), steps - 1)) * columns
    numbers, plans = settings.reshape(-1), schedule.reshape(-1)
    for k in range(packing.SIZE):
        for i in range(len(lane_set)):
            t[f.SETTINGS + k * LANES + i] = numbers[own[i] + k]
    for k in range(columns):
        for i in range(len(lane_set)):
            t[column(k) + i] = plans[now[i] + k]
