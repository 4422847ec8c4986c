"""The start of an episode."""

from formation_env.kernel import tile as field
from formation_env.kernel.stages.noise import LINK_UNIFORM
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Scalars
from formation_env.kernel.variants import own_scalars
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@inline_scalar
def begin_row(tile: Array, i: int, given: bool, settings: Scalars) -> None:
    """Start row i's next episode at the state that TRUTH holds, plus a random deviation.

    The truth deviates from the nominal start, which is the filter's first estimate; if the start was given, the truth
    is exactly there and the estimate deviates. Either way the initial error has the sigmas of `scenario.Start`.
    """
    for k in range(6):
        spread = (settings.spread_pos if k < 3 else settings.spread_vel) * tile[field.NORMAL + k * LANES + i]
        start = tile[field.TRUTH + k * LANES + i]
        tile[field.TRUTH + k * LANES + i] = start if given else start + spread
        tile[field.ESTIMATE + k * LANES + i] = start + spread if given else start
    for k in range(10):
        tile[field.P_IN_PLANE + k * LANES + i] = 0.0
    p, q = field.P_IN_PLANE + i, field.P_CROSS_TRACK + i
    tile[p], tile[p + 4 * LANES], tile[q] = (
        settings.initial_variance_pos,
        settings.initial_variance_pos,
        settings.initial_variance_pos,
    )
    tile[p + 7 * LANES], tile[p + 9 * LANES], tile[q + 2 * LANES] = (
        settings.initial_variance_vel,
        settings.initial_variance_vel,
        settings.initial_variance_vel,
    )
    tile[q + LANES] = 0.0
    tile[field.LINK_UP + i] = 1.0 if tile[LINK_UNIFORM + i] >= settings.link_loss else 0.0
    tile[field.AGE + i] = -settings.dt_s  # 0 at the first measurement, whether it arrives or not
    tile[field.DELTA_V + i] = 0.0
    for k in range(3):
        tile[field.THRUST + k * LANES + i] = 0.0
    for total in range(field.FIRST_TOTAL, field.FIRST_TOTAL + field.NUM_TOTALS * LANES, LANES):
        tile[total + i] = 0.0


@tile_function
def place(tile: Array, width: Width, starts: Array, given: bool, first: int) -> None:
    """Put the rows at their given starts, or at the nominal starts of their variants."""
    for i in range(len(width)):
        source = min(first + i, len(starts) - 1) if given else int(tile[field.VARIANT + i])
        for k in range(6):
            tile[field.TRUTH + k * LANES + i] = starts[source, k]


@tile_function
def begin(tile: Array, width: Width, given: bool, settings: Scalars | None) -> None:
    """Start an episode in each row."""
    for i in range(len(width)):
        begin_row(tile, i, given, own_scalars(tile, i, settings))
