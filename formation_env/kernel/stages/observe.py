"""The observation of a row (see `task.observation`), in single precision once the reference is subtracted."""

from typing import Final

import numpy as np

from formation_env.kernel.tile import STATE, WORK32, plan, seen
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function, turns
from formation_env.numerics.single_precision import log
from formation_env.task import observation
from formation_env.task.schedule import SCALES

# Offsets of the schedule's columns and of the observation's blocks: constants to the compiler.
REFERENCE: Final = plan("reference")
COAST_IN_PLANE: Final = plan("coast_in_plane")
COAST_CROSS_TRACK: Final = plan("coast_cross_track")
COAST_OFFSET: Final = plan("coast_offset")

ERROR: Final = seen("error")
MISS: Final = seen("zero_effort_miss")
ERROR_LOG: Final = seen("error_log")  # and that of the miss behind it
SIGMA_POS: Final = seen("sigma_pos")
SIGMA_VEL: Final = seen("sigma_vel")
MEASURED: Final = seen("measured")
AGE: Final = seen("measurement_age")
PER_LENGTH: Final = WORK32.scales + SCALES.index("per_length") * LANES
PER_SPEED: Final = WORK32.scales + SCALES.index("per_speed") * LANES
PER_STEP: Final = WORK32.scales + SCALES.index("per_step") * LANES
PER_LOG_AGE: Final = WORK32.scales + SCALES.index("per_log_age") * LANES

PER_LOG_RANGE: Final = np.float32(1 / np.log1p(observation.LOG_RANGE))
PER_LOG_SIGMA: Final = np.float32(1 / (2 * observation.SIGMA_DECADES * np.log(10)))
BOUND: Final = np.float32(observation.BOUND)
ONE: Final = np.float32(1)
PER_LOG_UNIT_POS: Final = np.float32(1 / observation.LOG_UNIT_POS_M)
PER_LOG_UNIT_VEL: Final = np.float32(1 / observation.LOG_UNIT_VEL_M_S)
PER_VARIANCE_POS: Final = observation.SIGMA_UNIT_POS_M**-2 / 3
PER_VARIANCE_VEL: Final = observation.SIGMA_UNIT_VEL_M_S**-2 / 3
VARIANCE_FLOOR: Final = np.float32(observation.SIGMA_FLOOR**2)


@inline_scalar
def _miss(state: Array, work: Array, work32: Array32, i: int) -> None:
    """Zero-effort miss: the error at the arrival if the follower coasts."""
    e, d = STATE.estimate + i, COAST_OFFSET + i
    x, y, u, v = state[e], state[e + LANES], state[e + 3 * LANES], state[e + 4 * LANES]
    z, w = state[e + 2 * LANES], state[e + 5 * LANES]
    for row in range(4):
        axis = row if row < 2 else row + 1
        k = COAST_IN_PLANE + 4 * row * LANES + i
        in_plane = work[k] * x + work[k + LANES] * y + work[k + 2 * LANES] * u + work[k + 3 * LANES] * v
        work32[MISS + axis * LANES + i] = np.float32(in_plane + work[d + axis * LANES])
    for row in range(2):
        axis = 2 + 3 * row
        k = COAST_CROSS_TRACK + 2 * row * LANES + i
        work32[MISS + axis * LANES + i] = np.float32(work[k] * z + work[k + LANES] * w + work[d + axis * LANES])


@inline_scalar
def _scale(work32: Array32, i: int, element: int, per_unit: int, per_log_unit: np.float32) -> None:
    """Scale an error, and compress it: sign(v) log(1 + |v|), 1 at LOG_RANGE; v in units."""
    error = work32[element + i]
    size = PER_LOG_RANGE * log(ONE + abs(per_log_unit * error))
    work32[element + ERROR_LOG - ERROR + i] = np.copysign(size, error)
    work32[element + i] = min(max(work32[per_unit + i] * error, -BOUND), BOUND)


@inline_scalar
def _sigmas(state: Array, work32: Array32, i: int) -> None:
    """Mean variances in their units, the link, and the age of the last measurement."""
    p, q = STATE.covariance_in_plane + i, STATE.covariance_cross_track + i
    position = state[p] + state[p + 4 * LANES] + state[q]
    velocity = state[p + 7 * LANES] + state[p + 9 * LANES] + state[q + 2 * LANES]
    work32[SIGMA_POS + i] = np.float32(PER_VARIANCE_POS * position)
    work32[SIGMA_VEL + i] = np.float32(PER_VARIANCE_VEL * velocity)
    work32[MEASURED + i] = np.float32(state[STATE.measured + i])
    work32[AGE + i] = np.float32(state[STATE.measurement_age + i])


@tile_function
def observe(state: Array, work: Array, work32: Array32, n: int) -> None:
    """Compute the observation of each row; what depends on the plan alone stands there already."""
    for axis in range(turns(6, state)):
        for i in range(min(n, LANES)):
            error = state[STATE.estimate + axis * LANES + i] - work[REFERENCE + axis * LANES + i]
            work32[ERROR + axis * LANES + i] = np.float32(error)
    for i in range(min(n, LANES)):
        _miss(state, work, work32, i)
    for i in range(min(n, LANES)):
        _sigmas(state, work32, i)
    for axis in range(turns(3, state)):
        for i in range(min(n, LANES)):
            _scale(work32, i, ERROR + axis * LANES, PER_LENGTH, PER_LOG_UNIT_POS)
        for i in range(min(n, LANES)):
            _scale(work32, i, ERROR + (3 + axis) * LANES, PER_SPEED, PER_LOG_UNIT_VEL)
        for i in range(min(n, LANES)):
            _scale(work32, i, MISS + axis * LANES, PER_LENGTH, PER_LOG_UNIT_POS)
        for i in range(min(n, LANES)):
            _scale(work32, i, MISS + (3 + axis) * LANES, PER_SPEED, PER_LOG_UNIT_VEL)
    for i in range(min(n, LANES)):
        work32[SIGMA_POS + i] = PER_LOG_SIGMA * log(max(work32[SIGMA_POS + i], VARIANCE_FLOOR))
        work32[SIGMA_VEL + i] = PER_LOG_SIGMA * log(max(work32[SIGMA_VEL + i], VARIANCE_FLOOR))
        work32[AGE + i] = work32[PER_LOG_AGE + i] * log(ONE + work32[PER_STEP + i] * work32[AGE + i])
