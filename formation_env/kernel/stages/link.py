"""The communication link: whether a measurement arrives."""

from typing import Final

from formation_env.kernel.settings import scalars
from formation_env.kernel.tile import STATE, WORK32, plan
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, tile_function

LINK_CLOSED: Final = plan("link_closed")


@tile_function
def change(state: Array, work32: Array32, settings: Array, n: int) -> None:
    """One transition of the link's chain."""
    for i in range(min(n, LANES)):
        chain = scalars(settings, i)
        down = chain.link_fail if state[STATE.link_up + i] > 0.5 else 1.0 - chain.link_recover
        state[STATE.link_up + i] = 1.0 if work32[WORK32.link_noise + i] >= down else 0.0


@tile_function
def receive(state: Array, work: Array, settings: Array, n: int) -> None:
    """Receive this instant's measurement or lose it, and update the age of the last one received."""
    for i in range(min(n, LANES)):
        measured = state[STATE.link_up + i] * (1.0 - work[LINK_CLOSED + i])
        state[STATE.measured + i] = measured
        age = state[STATE.measurement_age + i] + scalars(settings, i).dt_s
        state[STATE.measurement_age + i] = 0.0 if measured > 0.5 else age
