"""What a follower's observation shows of its neighbours (see `task.observation.NEIGHBOUR_BLOCKS`)."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages.closest_coast import closest_coast
from formation_env.kernel.stages.observe import (
    BOUND,
    ONE,
    PER_LENGTH,
    PER_LOG_AGE,
    PER_LOG_SIGMA,
    PER_SPEED,
    PER_STEP,
    PER_VARIANCE_POS,
    REFERENCE,
    VARIANCE_FLOOR,
)
from formation_env.kernel.stages.plan import eight_from
from formation_env.kernel.tile import STATE, WORK32
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.numerics.single_precision import log
from formation_env.numerics.transpose import BLOCK, transpose_block
from formation_env.task.observation import NEIGHBOUR_SIZE, NEIGHBOUR_SLICES, SIZE

Ranks = NDArray[np.int32]
Lanes = NDArray[np.intp]


def _offset(name: str) -> int:
    return NEIGHBOUR_SLICES[name].start * LANES


ESTIMATE: Final = _offset("relative_estimate")
DISTANCE: Final = _offset("closest_distance")
TIME: Final = _offset("closest_time")
MESSAGE_AGE: Final = _offset("message_age")
SIGMA: Final = _offset("relative_sigma_pos")
PRESENT: Final = _offset("present")
VIEW_SIZE: Final = NEIGHBOUR_SIZE * LANES
"""Scratch space of what a follower sees of one neighbour."""
KNOWN_SIZE: Final = 13 * LANES
"""Scratch space of what followers know of one another: scaled estimate and reference, and the position's variance."""
VARIANCE: Final = 12 * LANES
ZERO: Final = np.float32(0)
FAR: Final = np.float32(1e30)


@inline_scalar
def _variance(state: Array, i: int) -> np.float32:
    """Mean variance of the position, in its unit."""
    p = STATE.covariance_in_plane + i
    return np.float32(PER_VARIANCE_POS * (state[p] + state[p + 4 * LANES] + state[STATE.covariance_cross_track + i]))


@tile_function
def scale(state: Array, work: Array, work32: Array32, known: Array32, n: int) -> None:
    """Estimate and reference of a follower in units of the observation, and its variance.

    Args:
        state: its tile.
        work: scratch space with its plan.
        work32: scratch space with the scales.
        known: written (KNOWN_SIZE,).
        n: groups.
    """
    for k in range(6):
        per_unit = work32[PER_LENGTH if k < 3 else PER_SPEED :]
        estimate, reference = known[k * LANES :], known[(6 + k) * LANES :]
        own, planned = state[STATE.estimate + k * LANES :], work[REFERENCE + k * LANES :]
        for i in range(min(n, LANES)):
            estimate[i] = per_unit[i] * np.float32(own[i])
        for i in range(min(n, LANES)):
            reference[i] = per_unit[i] * np.float32(planned[i])
    for i in range(min(n, LANES)):
        known[VARIANCE + i] = _variance(state, i)


@tile_function
def _differences(known: Array32, other: Array32, view: Array32, n: int) -> None:
    """Relative estimate and reference, and the variance of the relative position, of two that hear each other."""
    for k in range(12):
        own, its, relative = known[k * LANES :], other[k * LANES :], view[k * LANES :]
        for i in range(min(n, LANES)):
            relative[i] = min(max(its[i] - own[i], -BOUND), BOUND)
    for i in range(min(n, LANES)):
        view[SIGMA + i] = known[VARIANCE + i] + other[VARIANCE + i]


@tile_function
def _by_message(known: Array32, work32: Array32, message: Array, lanes: Lanes, count: int, view: Array32) -> None:
    """The same by the last message, in the groups where the receiver does not hear the sender."""
    for at in range(count):
        i = lanes[at]
        for k in range(6):
            per_unit = work32[(PER_LENGTH if k < 3 else PER_SPEED) + i]
            estimate = per_unit * np.float32(message[STATE.estimate + k * LANES + i])
            view[ESTIMATE + k * LANES + i] = min(max(estimate - known[k * LANES + i], -BOUND), BOUND)
        view[SIGMA + i] = known[VARIANCE + i] + _variance(message, i)


# Long: its arguments.
@tile_function
def look(
    known: Array32,
    other: Array32,
    work32: Array32,
    message: Array,
    lanes: Lanes,
    deaf: int,
    age: Array,
    gone: Array,
    view: Array32,
    n: int,
) -> None:
    """Compute what a follower sees of another.

    Args:
        known: of the one who looks, see `scale`.
        other: of the other.
        work32: scratch space with the scales.
        message: the messages that it has of the other.
        lanes: groups in which they do not hear each other.
        deaf: how many these are.
        age: of the last message, s (LANES,).
        gone: 1 where the other's episode has ended (LANES,).
        view: written (VIEW_SIZE,).
        n: groups.
    """
    _differences(known, other, view, n)
    _by_message(known, work32, message, lanes, deaf, view)
    closest_coast(view[ESTIMATE:], view[DISTANCE:], view[TIME:], n)
    for i in range(min(n, LANES)):
        view[SIGMA + i] = PER_LOG_SIGMA * log(max(view[SIGMA + i], VARIANCE_FLOOR))
    for i in range(min(n, LANES)):
        view[MESSAGE_AGE + i] = work32[PER_LOG_AGE + i] * log(ONE + work32[PER_STEP + i] * np.float32(age[i]))
    for i in range(min(n, LANES)):
        view[PRESENT + i] = ONE
    for i in range(n):
        if gone[i] > 0.0:
            for k in range(NEIGHBOUR_SIZE):
                view[k * LANES + i] = ZERO
            view[DISTANCE + i] = FAR  # for the rank


@tile_function
def rank(views: Array32, ranks: Ranks, n: int) -> None:
    """Place of each neighbour in the observation: the least predicted distance first, those that are gone last.

    Args:
        views: of all neighbours (others, VIEW_SIZE); the distance of those that are gone is then shown as 0.
        ranks: written (others, LANES).
        n: groups.
    """
    ranks[:] = 0
    for a in range(len(views)):
        for b in range(a + 1, len(views)):
            mine, its = views[a, DISTANCE:], views[b, DISTANCE:]
            first, second = ranks[a], ranks[b]
            for i in range(min(n, LANES)):
                later = np.int32(its[i] < mine[i])
                first[i] += later
                second[i] += np.int32(1) - later
    for a in range(len(views)):
        distance = views[a, DISTANCE:]
        for i in range(min(n, LANES)):
            distance[i] = distance[i] if distance[i] < FAR else ZERO


@tile_function
def collect(views: Array32, ranks: Ranks, target: Array32, starts: Lanes, n: int) -> None:
    """Write what each row sees of its neighbours, in the order of their ranks.

    Args:
        views: of all neighbours (others, VIEW_SIZE).
        ranks: their places (others, LANES).
        target: flat.
        starts: where each row's neighbours go (LANES,).
        n: groups.
    """
    whole = n - n % BLOCK
    for neighbour in range(len(views)):
        view, own = views[neighbour], ranks[neighbour]
        for i in range(0, whole, BLOCK):
            places = (
                starts[i] + int(own[i]) * NEIGHBOUR_SIZE,
                starts[i + 1] + int(own[i + 1]) * NEIGHBOUR_SIZE,
                starts[i + 2] + int(own[i + 2]) * NEIGHBOUR_SIZE,
                starts[i + 3] + int(own[i + 3]) * NEIGHBOUR_SIZE,
                starts[i + 4] + int(own[i + 4]) * NEIGHBOUR_SIZE,
                starts[i + 5] + int(own[i + 5]) * NEIGHBOUR_SIZE,
                starts[i + 6] + int(own[i + 6]) * NEIGHBOUR_SIZE,
                starts[i + 7] + int(own[i + 7]) * NEIGHBOUR_SIZE,
            )
            for begin in range(0, NEIGHBOUR_SIZE, BLOCK):
                k = min(begin, NEIGHBOUR_SIZE - BLOCK)
                transpose_block(view[k * LANES + i :], eight_from(0, LANES), target[k:], places)
        for i in range(whole, n):
            for k in range(NEIGHBOUR_SIZE):
                target[starts[i] + int(own[i]) * NEIGHBOUR_SIZE + k] = view[k * LANES + i]


@tile_function
def write_own(work32: Array32, target: Array32, starts: Lanes, n: int) -> None:
    """Write each row's own part of the observation.

    Args:
        work32: scratch space with it.
        target: flat.
        starts: where it goes (LANES,).
        n: groups.
    """
    whole = n - n % BLOCK
    for i in range(0, whole, BLOCK):
        places = (
            starts[i],
            starts[i + 1],
            starts[i + 2],
            starts[i + 3],
            starts[i + 4],
            starts[i + 5],
            starts[i + 6],
            starts[i + 7],
        )
        for begin in range(0, SIZE, BLOCK):
            k = min(begin, SIZE - BLOCK)
            transpose_block(work32[WORK32.observation + k * LANES + i :], eight_from(0, LANES), target[k:], places)
    for i in range(whole, n):
        for k in range(SIZE):
            target[starts[i] + k] = work32[WORK32.observation + k * LANES + i]


@tile_function
def write(
    work32: Array32, views: Array32, ranks: Ranks, lines: Array32, shown: int, target: Any, starts: Lanes, n: int
) -> None:
    """Write observations.

    Args:
        work32: the rows' own part.
        views: of all neighbours.
        ranks: their places.
        lines: scratch space for all neighbours of LANES rows, a line each.
        shown: how many neighbours the observation shows.
        target: all observations, flat.
        starts: where those of the rows begin (LANES,).
        n: groups.
    """
    write_own(work32, target, starts, n)
    if shown == len(views):
        collect(views, ranks, target[SIZE:], starts, n)
    else:
        width = len(views) * NEIGHBOUR_SIZE
        collect(views, ranks, lines, np.arange(LANES) * width, n)
        for i in range(n):
            for k in range(shown * NEIGHBOUR_SIZE):
                target[starts[i] + SIZE + k] = lines[i * width + k]
