"""What a follower knows of another that it does not hear: the last message, propagated since.

While two hear each other, each message is the sender's estimate itself, and nothing is stored. When the link is lost,
the sender's estimate and covariance of the instant before are kept for the receiver, and updated in time by the
sender's model without thrust.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages.inter_satellite_link import WAS_HEARD, pair, place
from formation_env.kernel.tile import STATE, WORK, State
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

FIRST: Final = STATE.estimate
MESSAGE_SIZE: Final = State().estimate + State().covariance_in_plane + State().covariance_cross_track
"""Numbers of a message: the fields of a row's state from the estimate to its covariance, side by side."""
VARIANCES: Final = tuple(
    (field - FIRST) // LANES
    for field in (STATE.covariance_in_plane, STATE.covariance_in_plane + 4 * LANES, STATE.covariance_cross_track)
)
"""Places of the variances of the position in a message."""


@inline_scalar
def line(receiver: int, sender: int, count: int, lane: int) -> int:
    """Where the message begins that a receiver has of a sender, of `count` followers, in a group of the block."""
    return ((receiver * count + sender) * LANES + lane) * MESSAGE_SIZE


def block_size(count: int) -> int:
    """Numbers of a block of messages."""
    return count * count * LANES * MESSAGE_SIZE


# Long: its arguments.
@tile_function
def keep(
    sent: Array,
    receiver: int,
    sender: int,
    followers: int,
    links: Array,
    lanes: NDArray[np.intp],
    count: int,
    state: Array,
    everybody: bool,
) -> None:
    """Keep a sender's estimate and covariance, as they are, for a receiver that no longer hears it.

    Args:
        sent: messages of the block.
        receiver: who does not hear.
        sender: who is not heard.
        followers: of a group.
        links: of the block.
        lanes: groups in which they do not hear each other.
        count: how many these are.
        state: the sender's tile.
        everybody: also where they have not heard each other before (at the start).
    """
    was = links[place(pair(receiver, sender), WAS_HEARD) :]
    for k in range(count):
        i = lanes[k]
        if everybody or was[i] > 0.5:
            kept = sent[line(receiver, sender, followers, i) :]
            for number in range(MESSAGE_SIZE):
                kept[number] = state[FIRST + number * LANES + i]


@tile_function
def gather(
    sent: Array,
    receiver: int,
    sender: int,
    followers: int,
    lanes: NDArray[np.intp],
    count: int,
    side_by_side: bool,
    spare: Array,
) -> None:
    """Put messages in a spare tile, where a stage of the filter can update them.

    Args:
        sent: messages of the block.
        receiver: who does not hear.
        sender: who is not heard.
        followers: of a group.
        lanes: groups in which they do not hear each other.
        count: how many these are.
        side_by_side: whether the messages take the first rows, or those of their groups.
        spare: written.
    """
    for k in range(count):
        own, i = sent[line(receiver, sender, followers, lanes[k]) :], k if side_by_side else lanes[k]
        for number in range(MESSAGE_SIZE):
            spare[FIRST + number * LANES + i] = own[number]


@tile_function
def put_back(
    sent: Array,
    receiver: int,
    sender: int,
    followers: int,
    lanes: NDArray[np.intp],
    count: int,
    side_by_side: bool,
    spare: Array,
) -> None:
    """Put messages back; see `gather`."""
    for k in range(count):
        own, i = sent[line(receiver, sender, followers, lanes[k]) :], k if side_by_side else lanes[k]
        for number in range(MESSAGE_SIZE):
            own[number] = spare[FIRST + number * LANES + i]


@tile_function
def no_command(work: Array) -> None:
    """Let the sender's model coast: the others do not know of its thrust."""
    for k in range(WORK.command, WORK.command + 3 * LANES):
        work[k] = 0.0
