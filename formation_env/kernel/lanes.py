"""One step of one row, stage by stage, in the order in which the data flows.

    action -> thruster -> truth dynamics -> measurement -> dropout -> Kalman filter -> reward, end -> observation

Each stage reads and writes row i of a tile t (fields: see `tile`) and gets the settings it needs (see `packing`).
"""

from typing import Final

import numpy as np

from formation_env import observation, streams
from formation_env.dynamics.base import Array
from formation_env.fastmath import log, to_bits, to_integer
from formation_env.jit import LANES, lane
from formation_env.kernel import tile as f
from formation_env.kernel.packing import Scalars

# Offsets of the schedule's columns and of the observation's blocks, as the compiler needs them: constants.
REFERENCE: Final = f.plan("reference")
SCORED_POSITION: Final = f.plan("scored_position")
COAST_IN_PLANE: Final = f.plan("coast_in_plane")
COAST_CROSS_TRACK: Final = f.plan("coast_cross_track")
COAST_OFFSET: Final = f.plan("coast_offset")
LINK_CLOSED: Final = f.plan("link_closed")
ERROR_PRICE: Final = f.plan("error_price")
PRICE_LEFT: Final = f.plan("price_left")
COUNTS: Final = f.plan("counts")
COUNTS_LEFT: Final = f.plan("counts_left")
ARRIVES: Final = f.plan("arrives")
ARRIVES_LEFT: Final = f.plan("arrives_left")
TIME_TO_ARRIVAL: Final = f.plan("time_to_arrival")
IN_HOLD: Final = f.plan("in_hold")
PHASE: Final = f.plan("phase")
TIME_LEFT: Final = f.plan("time_left")

SEEN_ERROR: Final = f.seen("error")
SEEN_ARRIVAL: Final = f.seen("arrival_error")
SEEN_ERROR_LOG: Final = f.seen("error_log")
SEEN_ARRIVAL_LOG: Final = f.seen("arrival_error_log")
SEEN_REFERENCE: Final = f.seen("reference")
SEEN_TIME_TO_ARRIVAL: Final = f.seen("time_to_arrival")
SEEN_IN_HOLD: Final = f.seen("in_hold")
SEEN_PHASE: Final = f.seen("phase")
SEEN_TIME_LEFT: Final = f.seen("time_left")
SEEN_SIGMA_POS: Final = f.seen("sigma_pos")
SEEN_SIGMA_VEL: Final = f.seen("sigma_vel")
SEEN_MEASURED: Final = f.seen("measured")
SEEN_AGE: Final = f.seen("measurement_age")

PER_LOG_RANGE: Final = float(1 / np.log1p(observation.LOG_RANGE))
PER_LOG_SIGMA: Final = float(1 / (2 * observation.SIGMA_DECADES * np.log(10)))
BOUND: Final = observation.BOUND
PER_LOG_UNIT_POS: Final = 1 / observation.LOG_UNIT_POS_M
PER_LOG_UNIT_VEL: Final = 1 / observation.LOG_UNIT_VEL_M_S
PER_VARIANCE_POS: Final = observation.SIGMA_UNIT_POS_M**-2
PER_VARIANCE_VEL: Final = observation.SIGMA_UNIT_VEL_M_S**-2
VARIANCE_FLOOR: Final = observation.SIGMA_FLOOR**2

FIRST_PROCESS_NOISE: Final = f.NORMAL
FIRST_SENSOR_NOISE: Final = f.NORMAL + 3 * LANES
THRUST_NOISE: Final = f.NORMAL + 9 * LANES
LINK_UNIFORM: Final = f.UNIFORM + 10 * LANES


@lane
def draw_uniforms(t: Array, i: int, block: int, first_block: int) -> None:
    """Four uniforms of the row's stream: block 0, 1, 2 of the twelve."""
    counter = to_integer(streams.BLOCKS_PER_STEP * t[f.STEP + i]) + np.uint64(first_block + block)
    a, b = streams.threefry2x64(
        to_bits(t[f.KEY + i]), to_bits(t[f.KEY + LANES + i]), counter, to_integer(t[f.EPISODE + i])
    )
    u = f.UNIFORM + 4 * block * LANES + i
    t[u], t[u + LANES] = streams.uniform_pair(a)
    t[u + 2 * LANES], t[u + 3 * LANES] = streams.uniform_pair(b)


@lane
def draw_normals(t: Array, i: int, pair: int) -> None:
    """Two standard normals from two uniforms: pair 0 to 4."""
    u, v = f.UNIFORM + 2 * pair * LANES + i, f.NORMAL + 2 * pair * LANES + i
    t[v], t[v + LANES] = streams.normal_pair(t[u], t[u + LANES])


@lane
def thruster(t: Array, i: int, c: Scalars) -> None:
    """Action to acceleration: cut to the limit, nothing below the minimum, a random error of the magnitude."""
    x = c.max_accel * min(max(t[f.ACTION + i], -1.0), 1.0)
    y = c.max_accel * min(max(t[f.ACTION + LANES + i], -1.0), 1.0)
    z = c.max_accel * min(max(t[f.ACTION + 2 * LANES + i], -1.0), 1.0)
    magnitude = np.sqrt(x * x + y * y + z * z)
    fires = 1.0 if magnitude >= c.min_accel else 0.0
    gain = fires * (1.0 + c.thrust_noise * t[THRUST_NOISE + i])
    t[f.COMMAND + i], t[f.COMMAND + LANES + i], t[f.COMMAND + 2 * LANES + i] = fires * x, fires * y, fires * z
    t[f.THRUST + i], t[f.THRUST + LANES + i], t[f.THRUST + 2 * LANES + i] = gain * x, gain * y, gain * z
    t[f.DELTA_V + i] = abs(gain) * magnitude * c.dt_s


@lane
def link(t: Array, i: int, c: Scalars) -> None:
    """One transition of the link's chain."""
    down = c.link_fail if t[f.LINK_UP + i] > 0.5 else 1.0 - c.link_recover
    t[f.LINK_UP + i] = 1.0 if t[LINK_UNIFORM + i] >= down else 0.0


@lane
def dropout(t: Array, i: int, c: Scalars) -> None:
    """Whether this instant's measurement arrives, and the age of the last that did."""
    measured = t[f.LINK_UP + i] * (1.0 - t[LINK_CLOSED + i])
    t[f.MEASURED + i] = measured
    t[f.AGE + i] = 0.0 if measured > 0.5 else t[f.AGE + i] + c.dt_s


@lane
def reward_and_end(t: Array, i: int, c: Scalars) -> None:
    """Reward of the step and whether the episode ends (see `scenario.Reward` and `scenario.Limits`)."""
    x, y, z = t[f.TRUTH + i], t[f.TRUTH + LANES + i], t[f.TRUTH + 2 * LANES + i]
    dx, dy, dz = x - t[SCORED_POSITION + i], y - t[SCORED_POSITION + LANES + i], z - t[SCORED_POSITION + 2 * LANES + i]
    error = np.sqrt(dx * dx + dy * dy + dz * dz)
    outside = (error > c.max_distance) | (x * x + y * y + z * z < c.keep_out * c.keep_out)
    ends = outside & (t[f.STEP + i] > 0.0)
    # An early end costs as much as staying at the limit until the end, so that leaving never pays.
    stay = max(error, c.max_distance)
    stay_cost = t[PRICE_LEFT + i] * (c.linear_cost * stay + c.quadratic_cost * stay * stay)
    exit_cost = stay_cost if ends else 0.0
    error_cost = t[ERROR_PRICE + i] * (c.linear_cost * error + c.quadratic_cost * error * error)
    t[f.PHASE + i] = t[PHASE + i]
    t[f.POSITION_ERROR + i] = error
    t[f.ERROR_COST + i] = error_cost
    t[f.EXIT_COST + i] = exit_cost
    t[f.REWARD + i] = -(t[f.DELTA_V + i] + error_cost + exit_cost)
    t[f.TERMINATED + i] = 1.0 if ends else 0.0
    t[f.TRUNCATED + i] = 1.0 if t[f.STEP + i] >= c.num_steps else 0.0


@lane
def totals(t: Array, i: int, c: Scalars) -> None:
    """Sums of the episode; after an early end, what is left of it counts as flown at the limit."""
    error, counts = t[f.POSITION_ERROR + i], t[COUNTS + i]
    gone = 1.0 if t[f.TERMINATED + i] > 0.5 else 0.0
    missed = gone * t[COUNTS_LEFT + i]
    stay = max(error, c.max_distance)
    worst = max(counts * error, stay if missed > 0.0 else 0.0)
    t[f.SUM_REWARD + i] += t[f.REWARD + i]
    t[f.SUM_DELTA_V + i] += t[f.DELTA_V + i]
    t[f.SUM_ERROR + i] += counts * error + missed * stay
    t[f.SUM_SQUARE + i] += counts * error * error + missed * stay * stay
    t[f.MAX_ERROR + i] = max(t[f.MAX_ERROR + i], worst)
    t[f.ARRIVAL_ERROR + i] += t[ARRIVES + i] * error + gone * t[ARRIVES_LEFT + i] * stay
    t[f.TOLERATED + i] += counts if error <= c.tolerance else 0.0
    t[f.LOST + i] += 1.0 - t[f.MEASURED + i]


@lane
def _cut(value: float) -> float:
    return min(max(value, -BOUND), BOUND)


@lane
def _compress(value: float) -> float:
    """sign(v) log(1 + |v|), 1 at LOG_RANGE; v in units."""
    size = PER_LOG_RANGE * log(1.0 + abs(value))
    return size if value >= 0.0 else -size


@lane
def _see_error(t: Array, i: int, axis: int, error: float, linear: int, compressed: int, c: Scalars) -> None:
    per_unit = c.per_length if axis < 3 else c.per_speed
    per_log_unit = PER_LOG_UNIT_POS if axis < 3 else PER_LOG_UNIT_VEL
    t[linear + axis * LANES + i] = _cut(per_unit * error)
    t[compressed + axis * LANES + i] = _compress(per_log_unit * error)


@lane
def observe_error(t: Array, i: int, axis: int, c: Scalars) -> None:
    """One axis of the estimated error and of the reference."""
    reference = t[REFERENCE + axis * LANES + i]
    _see_error(t, i, axis, t[f.ESTIMATE + axis * LANES + i] - reference, SEEN_ERROR, SEEN_ERROR_LOG, c)
    t[SEEN_REFERENCE + axis * LANES + i] = _cut((c.per_length if axis < 3 else c.per_speed) * reference)


@lane
def observe_arrival(t: Array, i: int, c: Scalars) -> None:
    """The error that coasting leads to."""
    e, m, d = f.ESTIMATE + i, COAST_IN_PLANE + i, COAST_OFFSET + i
    x, y, u, v = t[e], t[e + LANES], t[e + 3 * LANES], t[e + 4 * LANES]
    z, w = t[e + 2 * LANES], t[e + 5 * LANES]
    for row in range(4):
        axis = row if row < 2 else row + 1
        k = m + 4 * row * LANES
        error = t[k] * x + t[k + LANES] * y + t[k + 2 * LANES] * u + t[k + 3 * LANES] * v + t[d + axis * LANES]
        _see_error(t, i, axis, error, SEEN_ARRIVAL, SEEN_ARRIVAL_LOG, c)
    for row in range(2):
        axis = 2 + 3 * row
        k = COAST_CROSS_TRACK + 2 * row * LANES + i
        _see_error(t, i, axis, t[k] * z + t[k + LANES] * w + t[d + axis * LANES], SEEN_ARRIVAL, SEEN_ARRIVAL_LOG, c)


@lane
def observe_rest(t: Array, i: int, c: Scalars) -> None:
    """Clock, filter's uncertainty and link."""
    t[SEEN_TIME_TO_ARRIVAL + i] = _cut(t[TIME_TO_ARRIVAL + i])
    t[SEEN_IN_HOLD + i] = t[IN_HOLD + i]
    t[SEEN_PHASE + i] = c.per_phase * t[PHASE + i]
    t[SEEN_TIME_LEFT + i] = _cut(t[TIME_LEFT + i])
    p, q = f.P_IN_PLANE + i, f.P_CROSS_TRACK + i
    variance_pos = (t[p] + t[p + 4 * LANES] + t[q]) / 3.0
    variance_vel = (t[p + 7 * LANES] + t[p + 9 * LANES] + t[q + 2 * LANES]) / 3.0
    t[SEEN_SIGMA_POS + i] = PER_LOG_SIGMA * log(max(PER_VARIANCE_POS * variance_pos, VARIANCE_FLOOR))
    t[SEEN_SIGMA_VEL + i] = PER_LOG_SIGMA * log(max(PER_VARIANCE_VEL * variance_vel, VARIANCE_FLOOR))
    t[SEEN_MEASURED + i] = t[f.MEASURED + i]
    t[SEEN_AGE + i] = c.per_log_age * log(1.0 + t[f.AGE + i] / c.dt_s)


@lane
def begin(t: Array, i: int, given: bool, c: Scalars) -> None:
    """Start row i's next episode about the start that TRUTH holds.

    The truth lies about the nominal start, which the filter takes for its first estimate; if the start was given, the
    truth is just there and the estimate lies about it. Either way the first error has the spread's covariance.
    """
    for k in range(6):
        spread = (c.spread_pos if k < 3 else c.spread_vel) * t[f.NORMAL + k * LANES + i]
        start = t[f.TRUTH + k * LANES + i]
        t[f.TRUTH + k * LANES + i] = start if given else start + spread
        t[f.ESTIMATE + k * LANES + i] = start + spread if given else start
    for k in range(10):
        t[f.P_IN_PLANE + k * LANES + i] = 0.0
    p, q = f.P_IN_PLANE + i, f.P_CROSS_TRACK + i
    t[p], t[p + 4 * LANES], t[q] = c.initial_variance_pos, c.initial_variance_pos, c.initial_variance_pos
    t[p + 7 * LANES], t[p + 9 * LANES], t[q + 2 * LANES] = (
        c.initial_variance_vel,
        c.initial_variance_vel,
        c.initial_variance_vel,
    )
    t[q + LANES] = 0.0
    t[f.LINK_UP + i] = 1.0 if t[LINK_UNIFORM + i] >= c.link_loss else 0.0
    t[f.AGE + i] = -c.dt_s  # 0 at the first measurement, whether it arrives or not
    t[f.DELTA_V + i] = 0.0
    for k in range(3):
        t[f.THRUST + k * LANES + i] = 0.0
    for total in range(f.FIRST_TOTAL, f.FIRST_TOTAL + f.NUM_TOTALS * LANES, LANES):
        t[total + i] = 0.0
