"""The observation of a row (see `task.observation`)."""

from typing import Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.stages.reward import PHASE
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Scalars
from formation_env.kernel.variants import own_scalars
from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import log
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.task import observation

# Offsets of the schedule's columns and of the observation's blocks: constants to the compiler.
REFERENCE: Final = field.plan("reference")
COAST_IN_PLANE: Final = field.plan("coast_in_plane")
COAST_CROSS_TRACK: Final = field.plan("coast_cross_track")
COAST_OFFSET: Final = field.plan("coast_offset")
TIME_TO_ARRIVAL: Final = field.plan("time_to_arrival")
IN_HOLD: Final = field.plan("in_hold")
TIME_LEFT: Final = field.plan("time_left")

SEEN_ERROR: Final = field.seen("error")
SEEN_MISS: Final = field.seen("zero_effort_miss")
SEEN_ERROR_LOG: Final = field.seen("error_log")
SEEN_MISS_LOG: Final = field.seen("zero_effort_miss_log")
SEEN_REFERENCE: Final = field.seen("reference")
SEEN_TIME_TO_ARRIVAL: Final = field.seen("time_to_arrival")
SEEN_IN_HOLD: Final = field.seen("in_hold")
SEEN_PHASE: Final = field.seen("phase")
SEEN_TIME_LEFT: Final = field.seen("time_left")
SEEN_SIGMA_POS: Final = field.seen("sigma_pos")
SEEN_SIGMA_VEL: Final = field.seen("sigma_vel")
SEEN_MEASURED: Final = field.seen("measured")
SEEN_AGE: Final = field.seen("measurement_age")

PER_LOG_RANGE: Final = float(1 / np.log1p(observation.LOG_RANGE))
PER_LOG_SIGMA: Final = float(1 / (2 * observation.SIGMA_DECADES * np.log(10)))
BOUND: Final = observation.BOUND
PER_LOG_UNIT_POS: Final = 1 / observation.LOG_UNIT_POS_M
PER_LOG_UNIT_VEL: Final = 1 / observation.LOG_UNIT_VEL_M_S
PER_VARIANCE_POS: Final = observation.SIGMA_UNIT_POS_M**-2
PER_VARIANCE_VEL: Final = observation.SIGMA_UNIT_VEL_M_S**-2
VARIANCE_FLOOR: Final = observation.SIGMA_FLOOR**2


@inline_scalar
def _cut(value: float) -> float:
    return min(max(value, -BOUND), BOUND)


@inline_scalar
def _compress(value: float) -> float:
    """sign(v) log(1 + |v|), 1 at LOG_RANGE; v in units."""
    size = PER_LOG_RANGE * log(1.0 + abs(value))
    return size if value >= 0.0 else -size


@inline_scalar
def _see_error(tile: Array, i: int, axis: int, error: float, linear: int, compressed: int, settings: Scalars) -> None:
    per_unit = settings.per_length if axis < 3 else settings.per_speed
    per_log_unit = PER_LOG_UNIT_POS if axis < 3 else PER_LOG_UNIT_VEL
    tile[linear + axis * LANES + i] = _cut(per_unit * error)
    tile[compressed + axis * LANES + i] = _compress(per_log_unit * error)


@inline_scalar
def observe_error(tile: Array, i: int, axis: int, settings: Scalars) -> None:
    """One axis of the estimated error and of the reference."""
    reference = tile[REFERENCE + axis * LANES + i]
    _see_error(tile, i, axis, tile[field.ESTIMATE + axis * LANES + i] - reference, SEEN_ERROR, SEEN_ERROR_LOG, settings)
    tile[SEEN_REFERENCE + axis * LANES + i] = _cut(
        (settings.per_length if axis < 3 else settings.per_speed) * reference
    )


@inline_scalar
def observe_miss(tile: Array, i: int, settings: Scalars) -> None:
    """Zero-effort miss: the error at the arrival if the follower coasts."""
    e, m, d = field.ESTIMATE + i, COAST_IN_PLANE + i, COAST_OFFSET + i
    x, y, u, v = tile[e], tile[e + LANES], tile[e + 3 * LANES], tile[e + 4 * LANES]
    z, w = tile[e + 2 * LANES], tile[e + 5 * LANES]
    for row in range(4):
        axis = row if row < 2 else row + 1
        k = m + 4 * row * LANES
        error = (
            tile[k] * x
            + tile[k + LANES] * y
            + tile[k + 2 * LANES] * u
            + tile[k + 3 * LANES] * v
            + tile[d + axis * LANES]
        )
        _see_error(tile, i, axis, error, SEEN_MISS, SEEN_MISS_LOG, settings)
    for row in range(2):
        axis = 2 + 3 * row
        k = COAST_CROSS_TRACK + 2 * row * LANES + i
        _see_error(
            tile,
            i,
            axis,
            tile[k] * z + tile[k + LANES] * w + tile[d + axis * LANES],
            SEEN_MISS,
            SEEN_MISS_LOG,
            settings,
        )


@inline_scalar
def observe_rest(tile: Array, i: int, settings: Scalars) -> None:
    """Clock, filter's uncertainty and link."""
    tile[SEEN_TIME_TO_ARRIVAL + i] = _cut(tile[TIME_TO_ARRIVAL + i])
    tile[SEEN_IN_HOLD + i] = tile[IN_HOLD + i]
    tile[SEEN_PHASE + i] = settings.per_phase * tile[PHASE + i]
    tile[SEEN_TIME_LEFT + i] = _cut(tile[TIME_LEFT + i])
    p, q = field.P_IN_PLANE + i, field.P_CROSS_TRACK + i
    variance_pos = (tile[p] + tile[p + 4 * LANES] + tile[q]) / 3.0
    variance_vel = (tile[p + 7 * LANES] + tile[p + 9 * LANES] + tile[q + 2 * LANES]) / 3.0
    tile[SEEN_SIGMA_POS + i] = PER_LOG_SIGMA * log(max(PER_VARIANCE_POS * variance_pos, VARIANCE_FLOOR))
    tile[SEEN_SIGMA_VEL + i] = PER_LOG_SIGMA * log(max(PER_VARIANCE_VEL * variance_vel, VARIANCE_FLOOR))
    tile[SEEN_MEASURED + i] = tile[field.MEASURED + i]
    tile[SEEN_AGE + i] = settings.per_log_age * log(1.0 + tile[field.AGE + i] / settings.dt_s)


@tile_function
def observe(tile: Array, width: Width, settings: Scalars | None) -> None:
    """Compute the observation of each row."""
    for axis in range(6):
        for i in range(len(width)):
            observe_error(tile, i, axis, own_scalars(tile, i, settings))
    for i in range(len(width)):
        observe_miss(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        observe_rest(tile, i, own_scalars(tile, i, settings))
