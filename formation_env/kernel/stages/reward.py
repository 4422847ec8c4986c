"""Reward of a step, end of the episode, and its totals."""

from typing import Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Scalars
from formation_env.kernel.variants import own_scalars
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

SCORED_POSITION: Final = field.plan("scored_position")
ERROR_WEIGHT: Final = field.plan("error_weight")
WEIGHT_LEFT: Final = field.plan("weight_left")
COUNTS: Final = field.plan("counts")
COUNTS_LEFT: Final = field.plan("counts_left")
ARRIVES: Final = field.plan("arrives")
ARRIVES_LEFT: Final = field.plan("arrives_left")
PHASE: Final = field.plan("phase")


@inline_scalar
def reward_and_end(tile: Array, i: int, settings: Scalars) -> None:
    """Reward of the step, and whether the episode ends (see `scenario.Reward` and `scenario.Limits`)."""
    x, y, z = tile[field.TRUTH + i], tile[field.TRUTH + LANES + i], tile[field.TRUTH + 2 * LANES + i]
    dx, dy, dz = (
        x - tile[SCORED_POSITION + i],
        y - tile[SCORED_POSITION + LANES + i],
        z - tile[SCORED_POSITION + 2 * LANES + i],
    )
    error = np.sqrt(dx * dx + dy * dy + dz * dz)
    outside = (error > settings.max_distance) | (x * x + y * y + z * z < settings.keep_out * settings.keep_out)
    ends = outside & (tile[field.STEP + i] > 0.0)
    # The penalty equals staying at the limit to the end, so leaving early never pays off.
    stay = max(error, settings.max_distance)
    stay_cost = tile[WEIGHT_LEFT + i] * (settings.linear_cost * stay + settings.quadratic_cost * stay * stay)
    exit_cost = stay_cost if ends else 0.0
    error_cost = tile[ERROR_WEIGHT + i] * (settings.linear_cost * error + settings.quadratic_cost * error * error)
    tile[field.PHASE + i] = tile[PHASE + i]
    tile[field.POSITION_ERROR + i] = error
    tile[field.ERROR_COST + i] = error_cost
    tile[field.EXIT_COST + i] = exit_cost
    tile[field.REWARD + i] = -(tile[field.DELTA_V + i] + error_cost + exit_cost)
    tile[field.TERMINATED + i] = 1.0 if ends else 0.0
    tile[field.TRUNCATED + i] = 1.0 if tile[field.STEP + i] >= settings.num_steps else 0.0


@inline_scalar
def totals(tile: Array, i: int, settings: Scalars) -> None:
    """Add the step to the episode's totals; an early end counts the instants left as flown at the distance limit."""
    error, counts = tile[field.POSITION_ERROR + i], tile[COUNTS + i]
    gone = 1.0 if tile[field.TERMINATED + i] > 0.5 else 0.0
    missed = gone * tile[COUNTS_LEFT + i]
    stay = max(error, settings.max_distance)
    worst = max(counts * error, stay if missed > 0.0 else 0.0)
    tile[field.SUM_REWARD + i] += tile[field.REWARD + i]
    tile[field.SUM_DELTA_V + i] += tile[field.DELTA_V + i]
    tile[field.SUM_ERROR + i] += counts * error + missed * stay
    tile[field.SUM_SQUARE + i] += counts * error * error + missed * stay * stay
    tile[field.MAX_ERROR + i] = max(tile[field.MAX_ERROR + i], worst)
    tile[field.ARRIVAL_ERROR + i] += tile[ARRIVES + i] * error + gone * tile[ARRIVES_LEFT + i] * stay
    tile[field.TOLERATED + i] += counts if error <= settings.tolerance else 0.0
    tile[field.LOST + i] += 1.0 - tile[field.MEASURED + i]


@tile_function
def score(tile: Array, width: Width, settings: Scalars | None) -> None:
    """Reward, end of the episode and totals."""
    for i in range(len(width)):
        reward_and_end(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        totals(tile, i, own_scalars(tile, i, settings))
