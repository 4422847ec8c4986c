"""The links between the followers of a group: whether two of them hear each other.

A block holds 64 groups side by side. Its links are fields of LANES numbers each, see `Places`.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.tile import STATE
from formation_env.numerics import random_streams
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function

Stream = NDArray[np.uint32]


class LinkSettings(NamedTuple):
    """Settings of the links, in the order of the line that holds them."""

    dt_s: float
    range_m: float
    loss: float  # probability that a link is down at the start
    fail: float
    recover: float
    windows: float  # 1 if a window closes them at some instant


# Fields of a pair in a block, and how many there are.
UP: Final = 0  # state of the dropout chain
HEARD: Final = 1  # 1 if the two heard each other at the last instant
WAS_HEARD: Final = 2  # the same at the instant before
AGE: Final = 3  # s since they last did
PAIR_SIZE: Final = 4


@inline_scalar
def pair(a: int, b: int) -> int:
    """Number of a pair of followers, whatever their order."""
    low, high = min(a, b), max(a, b)
    return high * (high - 1) // 2 + low


@inline_scalar
def place(number: int, field: int) -> int:
    """Offset of a pair's field."""
    return (number * PAIR_SIZE + field) * LANES


@inline_scalar
def _next_uniform(stream: Stream, i: int) -> np.float32:
    word, (s0, s1, s2, s3) = random_streams.next_word(
        stream[i], stream[LANES + i], stream[2 * LANES + i], stream[3 * LANES + i]
    )
    stream[i], stream[LANES + i], stream[2 * LANES + i], stream[3 * LANES + i] = s0, s1, s2, s3
    return random_streams.uniform(word)


@tile_function
def begin(links: Array, number: int, stream: Stream, settings: LinkSettings, n: int) -> None:
    """Draw whether a pair's link is up at the start."""
    up, heard, age = links[place(number, UP) :], links[place(number, HEARD) :], links[place(number, AGE) :]
    for i in range(min(n, LANES)):
        up[i] = 1.0 if _next_uniform(stream, i) >= settings.loss else 0.0
    for i in range(min(n, LANES)):
        heard[i] = 0.0
        age[i] = -settings.dt_s  # 0 at the first instant, whether they hear each other or not


@tile_function
def change(links: Array, number: int, stream: Stream, settings: LinkSettings, n: int) -> None:
    """One transition of the chain of a pair's link."""
    up = links[place(number, UP) :]
    for i in range(min(n, LANES)):
        down = settings.fail if up[i] > 0.5 else 1.0 - settings.recover
        up[i] = 1.0 if _next_uniform(stream, i) >= down else 0.0


@tile_function
def hear(links: Array, number: int, state: Array, other: Array, settings: LinkSettings, closed: Array, n: int) -> None:
    """Whether two followers hear each other at this instant, by the link and their true distance.

    Args:
        links: the block.
        number: of the pair.
        state: tile of the one.
        other: tile of the other.
        settings: of the links.
        closed: 1 while a dropout window is open, at each instant (steps + 1,).
        n: groups.
    """
    up, heard = links[place(number, UP) :], links[place(number, HEARD) :]
    was, age = links[place(number, WAS_HEARD) :], links[place(number, AGE) :]
    for i in range(min(n, LANES)):
        r = STATE.true_state + i
        dx, dy = state[r] - other[r], state[r + LANES] - other[r + LANES]
        dz = state[r + 2 * LANES] - other[r + 2 * LANES]
        within = dx * dx + dy * dy + dz * dz <= settings.range_m * settings.range_m
        was[i] = heard[i]
        heard[i] = up[i] if within else 0.0
    if settings.windows > 0.0:
        for i in range(n):
            heard[i] *= 1.0 - closed[min(int(state[STATE.step + i]), len(closed) - 1)]
    for i in range(min(n, LANES)):
        age[i] = (1.0 - heard[i]) * (age[i] + settings.dt_s)


@tile_function
def deaf(links: Array, number: int, lanes: NDArray[np.intp], n: int) -> int:
    """Find the groups in which the two of a pair do not hear each other.

    Args:
        links: of the block.
        number: of the pair.
        lanes: written (LANES,): their places.
        n: groups.

    Returns:
        How many there are.
    """
    heard, found = links[place(number, HEARD) :], 0
    for i in range(n):
        lanes[found] = i
        found += int(heard[i] < 0.5)
    return found
