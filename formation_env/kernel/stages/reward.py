"""Whether a step ends the episode or violates what is safe, its reward, and the episode's totals."""

from typing import Final

import numpy as np

from formation_env.kernel.settings import Scalars, scalars
from formation_env.kernel.tile import STATE, WORK, plan
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

SCORED_POSITION: Final = plan("scored_position")
ERROR_WEIGHT: Final = plan("error_weight")
WEIGHT_LEFT: Final = plan("weight_left")
COUNTS: Final = plan("counts")
COUNTS_LEFT: Final = plan("counts_left")
ARRIVES: Final = plan("arrives")
ARRIVES_LEFT: Final = plan("arrives_left")


@inline_scalar
def position_error(state: Array, work: Array, i: int) -> float:
    """Distance from the reference position."""
    s, r = STATE.true_state + i, SCORED_POSITION + i
    dx, dy, dz = state[s] - work[r], state[s + LANES] - work[r + LANES], state[s + 2 * LANES] - work[r + 2 * LANES]
    error: float = np.sqrt(dx * dx + dy * dy + dz * dz)
    return error


@tile_function
def check_distance(state: Array, work: Array, settings: Array, n: int) -> None:
    """Position error, and whether it ends the episode; nothing else is limited."""
    for i in range(min(n, LANES)):
        error = position_error(state, work, i)
        ends = (error > scalars(settings, i).max_distance) & (state[STATE.step + i] > 0.0)
        work[WORK.position_error + i] = error
        work[WORK.terminated + i] = 1.0 if ends else 0.0


@tile_function
def check_safety(state: Array, work: Array, settings: Array, n: int) -> None:
    """Position error, cost and whether the episode ends, by the least distances along the arc (`scenario.Safety`)."""
    for i in range(min(n, LANES)):
        own, error, flown = scalars(settings, i), position_error(state, work, i), state[STATE.step + i] > 0.0
        least, from_leader = work[WORK.least_distance + i], work[WORK.leader_distance + i]
        inside = from_leader < own.keep_out
        ends = (error > own.max_distance) | inside | (least < own.collision_distance)
        strays = (error > own.max_error) & (work[COUNTS + i] > 0.0)
        violates = inside | (least < own.min_distance) | strays
        work[WORK.position_error + i] = error
        work[WORK.terminated + i] = 1.0 if ends & flown else 0.0
        work[WORK.cost + i] = 1.0 if violates & flown else 0.0


@inline_scalar
def step_reward(state: Array, work: Array, i: int, settings: Scalars) -> None:
    """Reward of the step (see `scenario.Reward`), whose ends are checked already."""
    error, ends = work[WORK.position_error + i], work[WORK.terminated + i] > 0.0
    # The penalty equals staying at the limit to the end, so leaving early never pays off.
    stay = max(error, settings.max_distance)
    stay_cost = work[WEIGHT_LEFT + i] * (settings.linear_cost * stay + settings.quadratic_cost * stay * stay)
    exit_cost = stay_cost if ends else 0.0
    error_cost = work[ERROR_WEIGHT + i] * (settings.linear_cost * error + settings.quadratic_cost * error * error)
    work[WORK.error_cost + i] = error_cost
    work[WORK.exit_cost + i] = exit_cost
    work[WORK.reward + i] = -(work[WORK.delta_v + i] + error_cost + exit_cost)
    work[WORK.truncated + i] = 1.0 if state[STATE.step + i] >= settings.num_steps else 0.0


@inline_scalar
def totals(state: Array, work: Array, i: int, settings: Scalars) -> None:
    """Add the step to the episode's totals; an early end counts the instants left as flown at the distance limit."""
    error, counts = work[WORK.position_error + i], work[COUNTS + i]
    gone = work[WORK.terminated + i]
    missed = gone * work[COUNTS_LEFT + i]
    stay = max(error, settings.max_distance)
    worst = max(counts * error, stay if missed > 0.0 else 0.0)
    state[STATE.sum_reward + i] += work[WORK.reward + i]
    state[STATE.sum_delta_v + i] += work[WORK.delta_v + i]
    state[STATE.sum_error + i] += counts * error + missed * stay
    state[STATE.sum_square_error + i] += counts * error * error + missed * stay * stay
    state[STATE.max_error + i] = max(state[STATE.max_error + i], worst)
    state[STATE.arrival_error + i] += work[ARRIVES + i] * error + gone * work[ARRIVES_LEFT + i] * stay
    state[STATE.tolerated + i] += counts if error <= settings.tolerance else 0.0
    state[STATE.lost + i] += 1.0 - state[STATE.measured + i]


@tile_function
def score(state: Array, work: Array, settings: Array, n: int) -> None:
    """Reward and totals of a step whose ends are checked already."""
    for i in range(min(n, LANES)):
        step_reward(state, work, i, scalars(settings, i))
    for i in range(min(n, LANES)):
        totals(state, work, i, scalars(settings, i))
