"""What the followers of a group have in common: how it begins and how it ends."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.tile import STATE, WORK, State
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, tile_function

Keys = NDArray[np.uint64]

SLOTS_COUNTER: Final = np.uint64(1)  # 0 gives the streams of the episodes
LINKS_COUNTER: Final = np.uint64(2)
_LOW: Final = np.uint64(0xFFFFFFFF)
_SHIFT: Final = np.uint64(32)
_TOTALS: Final = STATE.step
_NUM_TOTALS: Final = sum(State()) - State._fields.index("step")


@tile_function
def draw_slots(keys: Keys, rows: NDArray[np.intp], slots: NDArray[np.int64], n: int) -> None:
    """Shuffle the slots (n, followers) of groups by numbers used for nothing else (Fisher & Yates).

    Args:
        keys: of all rows.
        rows: of the groups' first followers (n,).
        slots: 0, 1, ... in; shuffled out.
        n: groups.
    """
    for i in range(n):
        key = keys[rows[i]]
        for last in range(slots.shape[1] - 1, 0, -1):
            counter = SLOTS_COUNTER | np.uint64(last) << _SHIFT
            word, _ = random_streams.threefry2x64(key[0], key[1], counter, key[2])
            chosen = int((word >> _SHIFT) * np.uint64(last + 1) >> _SHIFT)
            slots[i, last], slots[i, chosen] = slots[i, chosen], slots[i, last]


@tile_function
def begin_link_streams(stream: NDArray[np.uint32], keys: Keys, rows: NDArray[np.intp], n: int) -> None:
    """Set the streams of the links between followers, by the keys of the groups' first followers."""
    for i in range(n):
        key = keys[rows[i]]
        a, b = random_streams.threefry2x64(key[0], key[1], LINKS_COUNTER, key[2])
        stream[i], stream[LANES + i] = np.uint32(a & _LOW), np.uint32(a >> _SHIFT)
        stream[2 * LANES + i], stream[3 * LANES + i] = np.uint32(b & _LOW), np.uint32(b >> _SHIFT)


@tile_function
def end_together(works: Array, n: int) -> None:
    """End the episodes of all followers of a group with the first."""
    for follower in range(1, len(works)):
        for i in range(min(n, LANES)):
            ends = max(works[0, WORK.terminated + i], works[follower, WORK.terminated + i])
            works[0, WORK.terminated + i] = ends
    for follower in range(1, len(works)):
        for i in range(min(n, LANES)):
            works[follower, WORK.terminated + i] = works[0, WORK.terminated + i]


@tile_function
def stay(state: Array, gone: Array, n: int) -> None:
    """Do not count the steps of followers whose episodes have ended."""
    for i in range(n):
        state[STATE.step + i] -= gone[i]


@tile_function
def set_aside(state: Array, gone: Array, totals: Array, n: int) -> None:
    """Keep the totals of followers whose episodes have ended."""
    for i in range(n):
        if gone[i] > 0.0:
            for k in range(_NUM_TOTALS):
                totals[k * LANES + i] = state[_TOTALS + k * LANES + i]


@tile_function
def leave_out(state: Array, work: Array, gone: Array, totals: Array, n: int) -> None:
    """Give followers whose episodes have ended neither reward nor cost, and their totals of then; they stay ended."""
    for i in range(n):
        if gone[i] > 0.0:
            for k in range(_NUM_TOTALS):
                state[_TOTALS + k * LANES + i] = totals[k * LANES + i]
            for field in (WORK.reward, WORK.delta_v, WORK.error_cost, WORK.exit_cost, WORK.cost):
                work[field + i] = 0.0
            work[WORK.least_distance + i] = np.inf
            work[WORK.terminated + i] = 1.0


@tile_function
def count_ended(works: Array, n: int) -> int:
    """Number of groups in which all episodes have ended."""
    ended = 0
    for i in range(n):
        left = 0
        for follower in range(len(works)):
            over = (works[follower, WORK.terminated + i] > 0.5) | (works[follower, WORK.truncated + i] > 0.5)
            left += int(not over)
        ended += int(left == 0)
    return ended
