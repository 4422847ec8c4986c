"""The true motion over one step: by one linear model, by one for each step, or by nonlinear equations."""

from typing import Final

import numpy as np

from formation_env.dynamics.nonlinear import FAR_FIELDS, FAR_WIDTH, FIELDS, NEAR_WIDTH, NODES
from formation_env.kernel import tile as field
from formation_env.kernel.stages.linear_model import propagate, read_model
from formation_env.kernel.stages.noise import FIRST_PROCESS_NOISE
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Forces, Model, Scalars
from formation_env.kernel.variants import own_forces, own_scalars
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


@inline_scalar
def total_acceleration(tile: Array, i: int, settings: Scalars) -> None:
    """Thrust and random acceleration, both held over the step, along LVLH."""
    n = FIRST_PROCESS_NOISE + i
    for k in range(3):
        tile[field.PUSH + k * LANES + i] = (
            tile[field.THRUST + k * LANES + i] + settings.process_noise * tile[n + k * LANES]
        )


@inline_scalar
def _linear(tile: Array, i: int, model: Model) -> None:
    propagate(
        tile,
        i,
        field.TRUTH,
        model,
        tile[field.PUSH + i],
        tile[field.PUSH + LANES + i],
        tile[field.PUSH + 2 * LANES + i],
    )


@tile_function
def fly_linear(tile: Array, width: Width, model: Model, settings: Scalars) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta, the same at each step."""
    for i in range(len(width)):
        total_acceleration(tile, i, settings)
    for i in range(len(width)):
        _linear(tile, i, model)


@tile_function
def fly_varying(tile: Array, width: Width, table: int, settings: Scalars | None) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta by the matrices of the row, which stand in the tile at `table`."""
    for i in range(len(width)):
        total_acceleration(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        _linear(tile, i, read_model(tile, i, table))


@tile_function
def fly_nonlinear(
    tile: Array, width: Width, table: int, far: bool, forces: Forces | None, settings: Scalars | None
) -> None:
    """Integrate the follower's motion relative to the leader along inertial axes (see `dynamics.nonlinear`).

    Args:
        tile: the tile.
        width: as long as the lanes computed.
        table: offset of the leader's table in the tile.
        far: whether Sun and Moon stand in it.
        forces: what acts.
        settings: the scenario's numbers.
    """
    node_width = (FAR_WIDTH if far else NEAR_WIDTH) * LANES
    dt_s, count = own_scalars(tile, 0, settings).dt_s, own_forces(tile, 0, forces).substeps  # the same for all rows
    substeps = int(count)
    last = table + len(NODES) * substeps * node_width
    step_s = dt_s / count
    for i in range(len(width)):
        total_acceleration(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        _to_inertial(tile, i, table, last + node_width)
    for substep in range(substeps):
        first = table + len(NODES) * substep * node_width
        for k in range(6):
            for i in range(len(width)):
                tile[field.BEFORE + k * LANES + i] = tile[field.RELATIVE + k * LANES + i]
        for number in range(_STAGES):
            _combine(tile, width, number, step_s)
            node = first + _NODE_OF_STAGE[number] * node_width
            _rates(tile, width, node, field.RATES + 6 * number * LANES, far, forces)
        _combine(tile, width, _STAGES, step_s)
    for i in range(len(width)):
        _to_lvlh(tile, i, last, last + node_width + 2 * LANES)


@tile_function
def _combine(tile: Array, width: Width, number: int, step_s: float) -> None:
    """y = y_0 + h sum_j a_j k_j, the state at which a stage takes its rates."""
    for k in range(6):
        for i in range(len(width)):
            tile[field.RELATIVE + k * LANES + i] = tile[field.BEFORE + k * LANES + i]
    for j in range(number):
        a = step_s * _A[number, j]
        if a != 0.0:
            for k in range(6):
                for i in range(len(width)):
                    y, rate = field.RELATIVE + k * LANES + i, field.RATES + (6 * j + k) * LANES + i
                    tile[y] = fma(a, tile[rate], tile[y])


@tile_function
def _rates(tile: Array, width: Width, node: int, rate: int, far: bool, forces: Forces | None) -> None:
    """Rates of the relative position and velocity at a node."""
    for i in range(len(width)):
        _near(tile, node + i, field.RELATIVE + i, rate + i, field.PUSH + i, own_forces(tile, i, forces))
    if far:
        for i in range(len(width)):
            _distant(tile, node + i, field.RELATIVE + i, rate + i, own_forces(tile, i, forces))


@inline_scalar
def _near(tile: Array, node: int, state: int, rate: int, push: int, forces: Forces) -> None:
    """Velocity, and acceleration by gravity, drag and thrust relative to the leader's."""
    x, y, z = (
        tile[node] + tile[state],
        tile[node + LANES] + tile[state + LANES],
        tile[node + 2 * LANES] + tile[state + 2 * LANES],
    )
    u, v, w = tile[state + 3 * LANES], tile[state + 4 * LANES], tile[state + 5 * LANES]
    gx, gy, gz = gravity(x, y, z, forces.j2)
    height = np.sqrt(x * x + y * y + z * z) - forces.base_radius
    density = forces.density * exp(-height * forces.per_scale_height)
    b = node + _VELOCITY
    vx, vy, vz = tile[b] + u, tile[b + LANES] + v, tile[b + 2 * LANES] + w
    dx, dy, dz = drag(vx, vy, vz, density, forces.drag_area)
    ax, ay, az = tile[push], tile[push + LANES], tile[push + 2 * LANES]
    a, b = node + _ACCELERATION, node + _AXES
    tile[rate], tile[rate + LANES], tile[rate + 2 * LANES] = u, v, w
    tile[rate + 3 * LANES] = gx + dx - tile[a] + (ax * tile[b] + ay * tile[b + 3 * LANES] + az * tile[b + 6 * LANES])
    b += LANES
    tile[rate + 4 * LANES] = (
        gy + dy - tile[a + LANES] + (ax * tile[b] + ay * tile[b + 3 * LANES] + az * tile[b + 6 * LANES])
    )
    b += LANES
    tile[rate + 5 * LANES] = (
        gz + dz - tile[a + 2 * LANES] + (ax * tile[b] + ay * tile[b + 3 * LANES] + az * tile[b + 6 * LANES])
    )


@inline_scalar
def _distant(tile: Array, node: int, state: int, rate: int, forces: Forces) -> None:
    """Add the accelerations by the Sun, the Moon and sunlight."""
    x, y, z = (
        tile[node] + tile[state],
        tile[node + LANES] + tile[state + LANES],
        tile[node + 2 * LANES] + tile[state + 2 * LANES],
    )
    b, m = node + _SUN, node + _MOON
    sx, sy, sz = tile[b], tile[b + LANES], tile[b + 2 * LANES]
    ax, ay, az = third_body(x, y, z, sx, sy, sz, forces.sun * MU_SUN)
    bx, by, bz = third_body(x, y, z, tile[m], tile[m + LANES], tile[m + 2 * LANES], forces.moon * MU_MOON)
    px, py, pz = radiation_pressure(x, y, z, sx, sy, sz, forces.radiation_area)
    tile[rate + 3 * LANES] += ax + bx + px
    tile[rate + 4 * LANES] += ay + by + py
    tile[rate + 5 * LANES] += az + bz + pz


@inline_scalar
def _to_inertial(tile: Array, i: int, node: int, turning: int) -> None:
    """LVLH state to position and velocity relative to the leader along inertial axes: v = rho' + omega x rho."""
    s, b, q = field.TRUTH + i, node + _AXES + i, field.RELATIVE + i
    x, y, z = tile[s], tile[s + LANES], tile[s + 2 * LANES]
    wx, wz = tile[turning + i], tile[turning + LANES + i]
    u = tile[s + 3 * LANES] - wz * y
    v = tile[s + 4 * LANES] + wz * x - wx * z
    w = tile[s + 5 * LANES] + wx * y
    for k in range(3):
        e = b + k * LANES
        tile[q + k * LANES] = x * tile[e] + y * tile[e + 3 * LANES] + z * tile[e + 6 * LANES]
        tile[q + (3 + k) * LANES] = u * tile[e] + v * tile[e + 3 * LANES] + w * tile[e + 6 * LANES]


@inline_scalar
def _to_lvlh(tile: Array, i: int, node: int, turning: int) -> None:
    """The way back: rho' = v - omega x rho."""
    s, b, q = field.TRUTH + i, node + _AXES + i, field.RELATIVE + i
    for k in range(3):
        e = b + 3 * k * LANES
        tile[s + k * LANES] = (
            tile[q] * tile[e] + tile[q + LANES] * tile[e + LANES] + tile[q + 2 * LANES] * tile[e + 2 * LANES]
        )
        tile[s + (3 + k) * LANES] = (
            tile[q + 3 * LANES] * tile[e]
            + tile[q + 4 * LANES] * tile[e + LANES]
            + tile[q + 5 * LANES] * tile[e + 2 * LANES]
        )
    x, y, z = tile[s], tile[s + LANES], tile[s + 2 * LANES]
    wx, wz = tile[turning + i], tile[turning + LANES + i]
    tile[s + 3 * LANES] += wz * y
    tile[s + 4 * LANES] -= wz * x - wx * z
    tile[s + 5 * LANES] -= wx * y
