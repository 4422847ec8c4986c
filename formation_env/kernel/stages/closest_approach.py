"""The least distance between two spacecraft along a step's arc, from the two end states.

Between two instants a position is the cubic that has the positions and velocities of both (Hermite's). A step is so
short that the distance has at most one least value within it: there where it falls at the start and grows at the end.
"""

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.settings import scalars
from formation_env.kernel.tile import STATE, WORK
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function, turns

Vector = tuple[float, float, float]


@inline_scalar
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline_scalar
def _cubic(t: float, a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    return (
        a[0] + t * (b[0] + t * (c[0] + t * d[0])),
        a[1] + t * (b[1] + t * (c[1] + t * d[1])),
        a[2] + t * (b[2] + t * (c[2] + t * d[2])),
    )


@inline_scalar
def _newton(t: float, a: Vector, b: Vector, c: Vector, d: Vector) -> float:
    """A step towards the place where r . r' = 0, kept within the arc."""
    r = _cubic(t, a, b, c, d)
    v = (
        b[0] + t * (2.0 * c[0] + t * 3.0 * d[0]),
        b[1] + t * (2.0 * c[1] + t * 3.0 * d[1]),
        b[2] + t * (2.0 * c[2] + t * 3.0 * d[2]),
    )
    w = 2.0 * c[0] + 6.0 * t * d[0], 2.0 * c[1] + 6.0 * t * d[1], 2.0 * c[2] + 6.0 * t * d[2]
    slope = _dot(v, v) + _dot(r, w)
    moved = t - _dot(r, v) / (slope if slope > 0.0 else 1.0)
    return min(max(moved, 0.0), 1.0)


@inline_scalar
def least_square(r0: Vector, v0: Vector, r1: Vector, v1: Vector, dt_s: float) -> float:
    """Squared least distance of two spacecraft along a step.

    Args:
        r0: relative position at the start, m.
        v0: relative velocity there, m/s.
        r1: relative position at the end.
        v1: relative velocity there.
        dt_s: the step.
    """
    b = v0[0] * dt_s, v0[1] * dt_s, v0[2] * dt_s
    e = v1[0] * dt_s, v1[1] * dt_s, v1[2] * dt_s
    s = r1[0] - r0[0], r1[1] - r0[1], r1[2] - r0[2]
    c = 3.0 * s[0] - 2.0 * b[0] - e[0], 3.0 * s[1] - 2.0 * b[1] - e[1], 3.0 * s[2] - 2.0 * b[2] - e[2]
    d = b[0] + e[0] - 2.0 * s[0], b[1] + e[1] - 2.0 * s[1], b[2] + e[2] - 2.0 * s[2]
    at_start, rise = _dot(r0, b), _dot(r1, e) - _dot(r0, b)
    t = min(max(-at_start / (rise if rise > 0.0 else 1.0), 0.0), 1.0)
    for _ in range(4):
        t = _newton(t, r0, b, c, d)
    r = _cubic(t, r0, b, c, d)
    return min(_dot(r, r), min(_dot(r0, r0), _dot(r1, r1)))


@inline_scalar
def ends_square(r0: Vector, v0: Vector, r1: Vector, v1: Vector) -> tuple[float, float]:
    """Squared distance at the nearer end, and 1 if the arc is nearer: the distance falls at the start, then grows."""
    inside = (_dot(r0, v0) < 0.0) & (_dot(r1, v1) > 0.0)
    return min(_dot(r0, r0), _dot(r1, r1)), 1.0 if inside else 0.0


@inline_scalar
def _position(fields: Array, at: int) -> Vector:
    return fields[at], fields[at + LANES], fields[at + 2 * LANES]


@inline_scalar
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@tile_function
def remember(state: Array, work: Array, n: int) -> None:
    """Keep the true state before the motion."""
    for k in range(turns(6, state)):
        for i in range(min(n, LANES)):
            work[WORK.start_state + k * LANES + i] = state[STATE.true_state + k * LANES + i]


@inline_scalar
def _motion(state: Array, work: Array, i: int) -> tuple[Vector, Vector, Vector, Vector]:
    """Position and velocity at both ends of the step."""
    s, r = WORK.start_state + i, STATE.true_state + i
    return (
        _position(work, s),
        _position(work, s + 3 * LANES),
        _position(state, r),
        _position(state, r + 3 * LANES),
    )


@inline_scalar
def _relative_motion(
    state: Array, work: Array, other_state: Array, other_work: Array, i: int
) -> tuple[Vector, Vector, Vector, Vector]:
    a, b = _motion(state, work, i), _motion(other_state, other_work, i)
    return _minus(a[0], b[0]), _minus(a[1], b[1]), _minus(a[2], b[2]), _minus(a[3], b[3])


@tile_function
def _list_inside(inside: Array, lanes: NDArray[np.intp], n: int) -> int:
    """List the rows whose arc is nearer than its ends; few are, and only a list keeps the rest from being computed."""
    found = 0
    for i in range(n):
        lanes[found] = i
        found += int(inside[i] > 0.0)
    return found


@tile_function
def approach_leader(state: Array, work: Array, settings: Array, n: int) -> None:
    """Squared least distance from the leader, which is the least of all up to now."""
    inside, lanes = np.empty(LANES), np.empty(LANES, np.intp)
    for i in range(min(n, LANES)):
        r0, v0, r1, v1 = _motion(state, work, i)
        work[WORK.leader_distance + i], inside[i] = ends_square(r0, v0, r1, v1)
    for k in range(_list_inside(inside, lanes, n)):
        i = lanes[k]
        r0, v0, r1, v1 = _motion(state, work, i)
        work[WORK.leader_distance + i] = least_square(r0, v0, r1, v1, scalars(settings, i).dt_s)
    for i in range(min(n, LANES)):
        work[WORK.least_distance + i] = work[WORK.leader_distance + i]


@tile_function
def approach(
    state: Array,
    work: Array,
    other_state: Array,
    other_work: Array,
    gone: Array,
    other_gone: Array,
    dt_s: float,
    n: int,
) -> None:
    """Squared least distances of two followers from each other, of all groups of a block; none from those gone."""
    inside, least, lanes = np.empty(LANES), np.empty(LANES), np.empty(LANES, np.intp)
    for i in range(min(n, LANES)):
        r0, v0, r1, v1 = _relative_motion(state, work, other_state, other_work, i)
        least[i], inside[i] = ends_square(r0, v0, r1, v1)
    for k in range(_list_inside(inside, lanes, n)):
        i = lanes[k]
        r0, v0, r1, v1 = _relative_motion(state, work, other_state, other_work, i)
        least[i] = least_square(r0, v0, r1, v1, dt_s)
    for i in range(min(n, LANES)):
        own = least[i] if gone[i] + other_gone[i] == 0.0 else np.inf
        work[WORK.least_distance + i] = min(work[WORK.least_distance + i], own)
        other_work[WORK.least_distance + i] = min(other_work[WORK.least_distance + i], own)


@tile_function
def end_approach(work: Array, n: int) -> None:
    """Turn the squared distances into distances."""
    for i in range(min(n, LANES)):
        work[WORK.leader_distance + i] = np.sqrt(work[WORK.leader_distance + i])
    for i in range(min(n, LANES)):
        work[WORK.least_distance + i] = np.sqrt(work[WORK.least_distance + i])
