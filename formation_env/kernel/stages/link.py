"""The communication link: whether a measurement arrives."""

from typing import Final

from formation_env.kernel import tile as field
from formation_env.kernel.stages.noise import LINK_UNIFORM
from formation_env.kernel.unpacking import Scalars
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import inline_scalar

LINK_CLOSED: Final = field.plan("link_closed")


@inline_scalar
def link(tile: Array, i: int, settings: Scalars) -> None:
    """One transition of the link's chain."""
    down = settings.link_fail if tile[field.LINK_UP + i] > 0.5 else 1.0 - settings.link_recover
    tile[field.LINK_UP + i] = 1.0 if tile[LINK_UNIFORM + i] >= down else 0.0


@inline_scalar
def dropout(tile: Array, i: int, settings: Scalars) -> None:
    """Receive this instant's measurement or lose it, and update the age of the last one received."""
    measured = tile[field.LINK_UP + i] * (1.0 - tile[LINK_CLOSED + i])
    tile[field.MEASURED + i] = measured
    tile[field.AGE + i] = 0.0 if measured > 0.5 else tile[field.AGE + i] + settings.dt_s
