"""The true motion over one step by nonlinear equations (see `dynamics.nonlinear`)."""

from typing import Final

import numpy as np

from formation_env.dynamics.nonlinear import FAR_FIELDS, FAR_WIDTH, FIELDS, NEAR_WIDTH, NODES
from formation_env.kernel.settings import Forces, forces, scalars
from formation_env.kernel.tile import STATE, WORK
from formation_env.numerics.arrays import Array
from formation_env.numerics.fastmath import exp, fma
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.orbital.accelerations import drag, gravity, radiation_pressure, third_body
from formation_env.orbital.constants import MU_MOON, MU_SUN

# Butcher's method of order 6 with 7 stages (Butcher 1964, "On Runge-Kutta processes of high order"). The last row
# gives the step's end.
_STAGES: Final = 7
_A: Final = np.array(
    [
        [0, 0, 0, 0, 0, 0, 0],
        [1 / 3, 0, 0, 0, 0, 0, 0],
        [0, 2 / 3, 0, 0, 0, 0, 0],
        [1 / 12, 1 / 3, -1 / 12, 0, 0, 0, 0],
        [-1 / 16, 9 / 8, -3 / 16, -3 / 8, 0, 0, 0],
        [0, 9 / 8, -3 / 8, -3 / 4, 1 / 2, 0, 0],
        [9 / 44, -9 / 11, 63 / 44, 18 / 11, 0, -16 / 11, 0],
        [11 / 120, 0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120],
    ]
)
_NODE_OF_STAGE: Final = (0, 1, 3, 1, 2, 2, 4)

_VELOCITY: Final = FIELDS["velocity"] * LANES
_ACCELERATION: Final = FIELDS["acceleration"] * LANES
_AXES: Final = FIELDS["x_axis"] * LANES  # and the other two behind it
_SUN: Final = FAR_FIELDS["sun"] * LANES
_MOON: Final = FAR_FIELDS["moon"] * LANES


@tile_function
def _fly(state: Array, work: Array, settings: Array, table: int, far: bool, n: int) -> None:
    """Integrate the follower's motion relative to the leader along inertial axes.

    Args:
        state: the tile.
        work: scratch space.
        settings: the rows' settings.
        table: the leader's table, as the place of its first number in the scratch space.
        far: whether Sun and Moon stand in it.
        n: rows.
    """
    node_width = (FAR_WIDTH if far else NEAR_WIDTH) * LANES
    dt_s, count = scalars(settings, 0).dt_s, forces(settings, 0).substeps  # the same for all rows
    substeps = int(count)
    start = table * LANES
    last = start + len(NODES) * substeps * node_width
    for i in range(min(n, LANES)):
        _to_inertial(state, work, i, start, last + node_width)
    for substep in range(substeps):
        first = start + len(NODES) * substep * node_width
        for k in range(6):
            for i in range(min(n, LANES)):
                work[WORK.before + k * LANES + i] = work[WORK.relative + k * LANES + i]
        for number in range(_STAGES):
            _combine(work, number, dt_s / count, n)
            node = first + _NODE_OF_STAGE[number] * node_width
            _rates(work, settings, node, WORK.rates + 6 * number * LANES, far, n)
        _combine(work, _STAGES, dt_s / count, n)
    for i in range(min(n, LANES)):
        _to_lvlh(state, work, i, last, last + node_width + 2 * LANES)


@tile_function
def fly_near(state: Array, work: Array, settings: Array, table: int, n: int) -> None:
    """Fly under gravity and drag."""
    _fly(state, work, settings, table, False, n)


@tile_function
def fly_far(state: Array, work: Array, settings: Array, table: int, n: int) -> None:
    """Fly under the Sun, the Moon and radiation pressure, too."""
    _fly(state, work, settings, table, True, n)


@tile_function
def _combine(work: Array, number: int, step_s: float, n: int) -> None:
    """y = y_0 + h sum_j a_j k_j, the state at which a stage takes its rates."""
    for k in range(6):
        for i in range(min(n, LANES)):
            work[WORK.relative + k * LANES + i] = work[WORK.before + k * LANES + i]
    for j in range(number):
        a = step_s * _A[number, j]
        if a != 0.0:
            for k in range(6):
                for i in range(min(n, LANES)):
                    y, rate = WORK.relative + k * LANES + i, WORK.rates + (6 * j + k) * LANES + i
                    work[y] = fma(a, work[rate], work[y])


@tile_function
def _rates(work: Array, settings: Array, node: int, rate: int, far: bool, n: int) -> None:
    """Rates of the relative position and velocity at a node."""
    for i in range(min(n, LANES)):
        _near(work, node + i, WORK.relative + i, rate + i, WORK.push + i, forces(settings, i))
    if far:
        for i in range(min(n, LANES)):
            _distant(work, node + i, WORK.relative + i, rate + i, forces(settings, i))


@inline_scalar
def _near(work: Array, node: int, state: int, rate: int, push: int, acting: Forces) -> None:
    """Velocity, and acceleration by gravity, drag and thrust relative to the leader's."""
    x, y, z = (
        work[node] + work[state],
        work[node + LANES] + work[state + LANES],
        work[node + 2 * LANES] + work[state + 2 * LANES],
    )
    u, v, w = work[state + 3 * LANES], work[state + 4 * LANES], work[state + 5 * LANES]
    gx, gy, gz = gravity(x, y, z, acting.j2)
    height = np.sqrt(x * x + y * y + z * z) - acting.base_radius
    density = acting.density * exp(-height * acting.per_scale_height)
    b = node + _VELOCITY
    vx, vy, vz = work[b] + u, work[b + LANES] + v, work[b + 2 * LANES] + w
    dx, dy, dz = drag(vx, vy, vz, density, acting.drag_area)
    ax, ay, az = work[push], work[push + LANES], work[push + 2 * LANES]
    a, b = node + _ACCELERATION, node + _AXES
    work[rate], work[rate + LANES], work[rate + 2 * LANES] = u, v, w
    work[rate + 3 * LANES] = gx + dx - work[a] + (ax * work[b] + ay * work[b + 3 * LANES] + az * work[b + 6 * LANES])
    b += LANES
    work[rate + 4 * LANES] = (
        gy + dy - work[a + LANES] + (ax * work[b] + ay * work[b + 3 * LANES] + az * work[b + 6 * LANES])
    )
    b += LANES
    work[rate + 5 * LANES] = (
        gz + dz - work[a + 2 * LANES] + (ax * work[b] + ay * work[b + 3 * LANES] + az * work[b + 6 * LANES])
    )


@inline_scalar
def _distant(work: Array, node: int, state: int, rate: int, acting: Forces) -> None:
    """Add the accelerations by the Sun, the Moon and sunlight."""
    x, y, z = (
        work[node] + work[state],
        work[node + LANES] + work[state + LANES],
        work[node + 2 * LANES] + work[state + 2 * LANES],
    )
    b, m = node + _SUN, node + _MOON
    sx, sy, sz = work[b], work[b + LANES], work[b + 2 * LANES]
    ax, ay, az = third_body(x, y, z, sx, sy, sz, acting.sun * MU_SUN)
    bx, by, bz = third_body(x, y, z, work[m], work[m + LANES], work[m + 2 * LANES], acting.moon * MU_MOON)
    px, py, pz = radiation_pressure(x, y, z, sx, sy, sz, acting.radiation_area)
    work[rate + 3 * LANES] += ax + bx + px
    work[rate + 4 * LANES] += ay + by + py
    work[rate + 5 * LANES] += az + bz + pz


@inline_scalar
def _to_inertial(state: Array, work: Array, i: int, node: int, turning: int) -> None:
    """LVLH state to position and velocity relative to the leader along inertial axes: v = rho' + omega x rho."""
    s, b, q = STATE.true_state + i, node + _AXES + i, WORK.relative + i
    x, y, z = state[s], state[s + LANES], state[s + 2 * LANES]
    wx, wz = work[turning + i], work[turning + LANES + i]
    u = state[s + 3 * LANES] - wz * y
    v = state[s + 4 * LANES] + wz * x - wx * z
    w = state[s + 5 * LANES] + wx * y
    for k in range(3):
        e = b + k * LANES
        work[q + k * LANES] = x * work[e] + y * work[e + 3 * LANES] + z * work[e + 6 * LANES]
        work[q + (3 + k) * LANES] = u * work[e] + v * work[e + 3 * LANES] + w * work[e + 6 * LANES]


@inline_scalar
def _to_lvlh(state: Array, work: Array, i: int, node: int, turning: int) -> None:
    """The way back: rho' = v - omega x rho."""
    s, b, q = STATE.true_state + i, node + _AXES + i, WORK.relative + i
    for k in range(3):
        e = b + 3 * k * LANES
        state[s + k * LANES] = (
            work[q] * work[e] + work[q + LANES] * work[e + LANES] + work[q + 2 * LANES] * work[e + 2 * LANES]
        )
        state[s + (3 + k) * LANES] = (
            work[q + 3 * LANES] * work[e]
            + work[q + 4 * LANES] * work[e + LANES]
            + work[q + 5 * LANES] * work[e + 2 * LANES]
        )
    x, y, z = state[s], state[s + LANES], state[s + 2 * LANES]
    wx, wz = work[turning + i], work[turning + LANES + i]
    state[s + 3 * LANES] += wz * y
    state[s + 4 * LANES] -= wz * x - wx * z
    state[s + 5 * LANES] -= wx * y
