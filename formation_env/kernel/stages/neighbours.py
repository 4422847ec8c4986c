"""What a follower's observation shows of its neighbours (see `task.observation.NEIGHBOUR_BLOCKS`)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages.closest_coast import closest_coast
from formation_env.kernel.stages.messages import VARIANCES
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
from formation_env.kernel.tile import STATE
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function, whole_vectors
from formation_env.numerics.single_precision import log
from formation_env.task.observation import NEIGHBOUR_SIZE, NEIGHBOUR_SLICES

Lanes = NDArray[np.intp]


def _offset(name: str) -> int:
    return int(NEIGHBOUR_SLICES[name].start) * LANES


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
NUM_RELATIVE: Final = NEIGHBOUR_SLICES["closest_distance"].start
"""How many numbers have opposite signs for the other; those behind are equal for both."""
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
def _differences(known: Array32, other: Array32, view: Array32, its_view: Array32, n: int) -> None:
    """Relative estimate and reference of two that hear each other, as either sees them, and their variance."""
    for k in range(NUM_RELATIVE):
        own, its, relative, opposite = known[k * LANES :], other[k * LANES :], view[k * LANES :], its_view[k * LANES :]
        for i in range(min(n, LANES)):
            relative[i] = min(max(its[i] - own[i], -BOUND), BOUND)
        for i in range(min(n, LANES)):
            opposite[i] = -relative[i]
    for i in range(min(n, LANES)):
        view[SIGMA + i] = known[VARIANCE + i] + other[VARIANCE + i]


@tile_function
def meet(known: Array32, other: Array32, work32: Array32, age: Array, view: Array32, its_view: Array32, n: int) -> None:
    """Compute what two followers see of each other where they hear each other.

    Args:
        known: of the one, see `scale`.
        other: of the other.
        work32: scratch space with the scales.
        age: of the last messages, s (LANES,).
        view: what the one sees, written (VIEW_SIZE,).
        its_view: what the other sees, written.
        n: groups.
    """
    _differences(known, other, view, its_view, n)
    closest_coast(view[ESTIMATE:], view[DISTANCE:], view[TIME:], n)
    for i in range(min(n, LANES)):
        view[SIGMA + i] = PER_LOG_SIGMA * log(max(view[SIGMA + i], VARIANCE_FLOOR))
    for i in range(min(n, LANES)):
        view[MESSAGE_AGE + i] = work32[PER_LOG_AGE + i] * log(ONE + work32[PER_STEP + i] * np.float32(age[i]))
    for i in range(min(n, LANES)):
        view[PRESENT + i] = ONE
    for k in range(NUM_RELATIVE, NEIGHBOUR_SIZE):
        own, its = view[k * LANES :], its_view[k * LANES :]
        for i in range(min(n, LANES)):
            its[i] = own[i]


@tile_function
def remember(
    known: Array32, work32: Array32, sent: Array, lines: Lanes, lanes: Lanes, count: int, view: Array32, spare: Array32
) -> None:
    """Compute what a follower sees of another by its last message, where they do not hear each other.

    Args:
        known: of the one who looks, see `scale`.
        work32: scratch space with the scales.
        sent: messages of the block.
        lines: where the messages begin (count,).
        lanes: groups in which they do not hear each other (count,).
        count: how many these are.
        view: written in these groups.
        spare: scratch space of the size of a view.
    """
    for k in range(count):
        i, message = lanes[k], sent[lines[k] :]
        for axis in range(6):
            per_unit = work32[(PER_LENGTH if axis < 3 else PER_SPEED) + i]
            estimate = per_unit * np.float32(message[axis])
            spare[axis * LANES + k] = min(max(estimate - known[axis * LANES + i], -BOUND), BOUND)
        variance = message[VARIANCES[0]] + message[VARIANCES[1]] + message[VARIANCES[2]]
        spare[SIGMA + k] = known[VARIANCE + i] + np.float32(PER_VARIANCE_POS * variance)
    whole = whole_vectors(count)
    closest_coast(spare, spare[DISTANCE:], spare[TIME:], whole)
    for k in range(min(whole, LANES)):
        spare[SIGMA + k] = PER_LOG_SIGMA * log(max(spare[SIGMA + k], VARIANCE_FLOOR))
    for k in range(count):
        i = lanes[k]
        for axis in range(6):
            view[ESTIMATE + axis * LANES + i] = spare[axis * LANES + k]
        view[DISTANCE + i], view[TIME + i], view[SIGMA + i] = spare[DISTANCE + k], spare[TIME + k], spare[SIGMA + k]


@tile_function
def miss(gone: Array, view: Array32, n: int) -> None:
    """Show nothing of a follower whose episode has ended, but rank it behind all others."""
    for i in range(n):
        if gone[i] > 0.0:
            for k in range(NEIGHBOUR_SIZE):
                view[k * LANES + i] = ZERO
            view[DISTANCE + i] = FAR
