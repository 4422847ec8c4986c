"""What a follower knows of another that it does not hear: the last message, propagated since.

While two hear each other, each message is the sender's estimate itself, and nothing is stored. When the link is lost,
the sender's estimate and covariance of the instant before are kept for the receiver, and updated in time by the
sender's model without thrust.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages.inter_satellite_link import WAS_HEARD, place
from formation_env.kernel.tile import STATE, WORK, State
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

FIRST: Final = STATE.estimate
MESSAGE_SIZE: Final = State().estimate + State().covariance_in_plane + State().covariance_cross_track
"""Numbers of a message: the fields of a row's state from the estimate to its covariance."""


@inline_scalar
def message(receiver: int, sender: int, count: int) -> int:
    """Where the message that a receiver has of a sender begins, of `count` followers.

    From there on the fields lie as in a row's state; those before the estimate belong to other messages.
    """
    return (receiver * count + sender) * MESSAGE_SIZE * LANES


def block_size(count: int) -> int:
    """Numbers of a block of messages."""
    return count * count * MESSAGE_SIZE * LANES + FIRST


@tile_function
def keep(
    kept: Array, links: Array, number: int, lanes: NDArray[np.intp], count: int, state: Array, everybody: bool
) -> None:
    """Keep a sender's estimate and covariance, as they are, for those that no longer hear it.

    Args:
        kept: the messages that a receiver has of the sender, see `message`.
        links: of the block.
        number: of the pair.
        lanes: groups in which the receiver does not hear the sender.
        count: how many these are.
        state: the sender's tile.
        everybody: also for those that have not heard it before (at the start).
    """
    was = links[place(number, WAS_HEARD) :]
    for k in range(count):
        i = lanes[k]
        if everybody or was[i] > 0.5:
            for field in range(FIRST, FIRST + MESSAGE_SIZE * LANES, LANES):
                kept[field + i] = state[field + i]


@tile_function
def no_command(work: Array) -> None:
    """Let the sender's model coast: the others do not know of its thrust."""
    for k in range(WORK.command, WORK.command + 3 * LANES):
        work[k] = 0.0
