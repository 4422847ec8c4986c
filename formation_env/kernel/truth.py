"""The true motion over one step: by one linear model, by one for each step, or by nonlinear equations."""

from typing import Final

import numpy as np

from formation_env.constants import MU_MOON, MU_SUN
from formation_env.dynamics.base import Array
from formation_env.dynamics.nonlinear import FAR_FIELDS, FAR_WIDTH, FIELDS, NEAR_WIDTH, NODES
from formation_env.fastmath import exp, fma
from formation_env.forces import drag, gravity, radiation_pressure, third_body
from formation_env.jit import LANES, lane, stage
from formation_env.kernel import lanes
from formation_env.kernel import tile as f
from formation_env.kernel.linear import propagate, read_model
from formation_env.kernel.packing import Forces, Model, Scalars
from formation_env.kernel.tile import LaneSet
from formation_env.kernel.variants import own_forces, own_scalars

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


@lane
def total_acceleration(t: Array, i: int, c: Scalars) -> None:
    """Thrust and random acceleration, both held over the step, along LVLH."""
    n = lanes.FIRST_PROCESS_NOISE + i
    for k in range(3):
        t[f.PUSH + k * LANES + i] = t[f.THRUST + k * LANES + i] + c.process_noise * t[n + k * LANES]


@lane
def _linear(t: Array, i: int, model: Model) -> None:
    propagate(t, i, f.TRUTH, model, t[f.PUSH + i], t[f.PUSH + LANES + i], t[f.PUSH + 2 * LANES + i])


@stage
def fly_linear(t: Array, lane_set: LaneSet, model: Model, c: Scalars) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta, the same at each step."""
    for i in range(len(lane_set)):
        total_acceleration(t, i, c)
    for i in range(len(lane_set)):
        _linear(t, i, model)


@stage
def fly_varying(t: Array, lane_set: LaneSet, table: int, c: Scalars | None) -> None:
    """The same with the row's own matrices, which the tile has at `table`."""
    for i in range(len(lane_set)):
        total_acceleration(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        _linear(t, i, read_model(t, i, table))


@stage
def fly_nonlinear(t: Array, lane_set: LaneSet, table: int, far: bool, forces: Forces | None, c: Scalars | None) -> None:
    """Integrate the follower's motion relative to the leader along inertial axes (see `dynamics.nonlinear`).

    Args:
        t: the tile.
        lane_set: as long as the lanes computed.
        table: offset of the leader's table in the tile.
        far: whether Sun and Moon stand in it.
        forces: what acts.
        c: the scenario's numbers.
    """
    width = (FAR_WIDTH if far else NEAR_WIDTH) * LANES
    dt_s, count = own_scalars(t, 0, c).dt_s, own_forces(t, 0, forces).substeps  # the same for all rows
    substeps = int(count)
    last = table + len(NODES) * substeps * width
    step_s = dt_s / count
    for i in range(len(lane_set)):
        total_acceleration(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        _to_inertial(t, i, table, last + width)
    for substep in range(substeps):
        first = table + len(NODES) * substep * width
        for k in range(6):
            for i in range(len(lane_set)):
                t[f.BEFORE + k * LANES + i] = t[f.RELATIVE + k * LANES + i]
        for number in range(_STAGES):
            _combine(t, lane_set, number, step_s)
            _rates(t, lane_set, first + _NODE_OF_STAGE[number] * width, f.RATES + 6 * number * LANES, far, forces)
        _combine(t, lane_set, _STAGES, step_s)
    for i in range(len(lane_set)):
        _to_lvlh(t, i, last, last + width + 2 * LANES)


@stage
def _combine(t: Array, lane_set: LaneSet, number: int, step_s: float) -> None:
    """y = y_0 + h sum_j a_j k_j, the state at which a stage takes its rates."""
    for k in range(6):
        for i in range(len(lane_set)):
            t[f.RELATIVE + k * LANES + i] = t[f.BEFORE + k * LANES + i]
    for j in range(number):
        a = step_s * _A[number, j]
        if a != 0.0:
            for k in range(6):
                for i in range(len(lane_set)):
                    y, rate = f.RELATIVE + k * LANES + i, f.RATES + (6 * j + k) * LANES + i
                    t[y] = fma(a, t[rate], t[y])


@stage
def _rates(t: Array, lane_set: LaneSet, node: int, rate: int, far: bool, forces: Forces | None) -> None:
    """Rates of the relative position and velocity at a node."""
    for i in range(len(lane_set)):
        _near(t, node + i, f.RELATIVE + i, rate + i, f.PUSH + i, own_forces(t, i, forces))
    if far:
        for i in range(len(lane_set)):
            _distant(t, node + i, f.RELATIVE + i, rate + i, own_forces(t, i, forces))


@lane
def _near(t: Array, node: int, state: int, rate: int, push: int, forces: Forces) -> None:
    """Velocity, and acceleration by gravity, drag and thrust relative to the leader's."""
    x, y, z = t[node] + t[state], t[node + LANES] + t[state + LANES], t[node + 2 * LANES] + t[state + 2 * LANES]
    u, v, w = t[state + 3 * LANES], t[state + 4 * LANES], t[state + 5 * LANES]
    gx, gy, gz = gravity(x, y, z, forces.j2)
    height = np.sqrt(x * x + y * y + z * z) - forces.base_radius
    density = forces.density * exp(-height * forces.per_scale_height)
    b = node + _VELOCITY
    vx, vy, vz = t[b] + u, t[b + LANES] + v, t[b + 2 * LANES] + w
    dx, dy, dz = drag(vx, vy, vz, density, forces.drag_area)
    ax, ay, az = t[push], t[push + LANES], t[push + 2 * LANES]
    a, b = node + _ACCELERATION, node + _AXES
    t[rate], t[rate + LANES], t[rate + 2 * LANES] = u, v, w
    t[rate + 3 * LANES] = gx + dx - t[a] + (ax * t[b] + ay * t[b + 3 * LANES] + az * t[b + 6 * LANES])
    b += LANES
    t[rate + 4 * LANES] = gy + dy - t[a + LANES] + (ax * t[b] + ay * t[b + 3 * LANES] + az * t[b + 6 * LANES])
    b += LANES
    t[rate + 5 * LANES] = gz + dz - t[a + 2 * LANES] + (ax * t[b] + ay * t[b + 3 * LANES] + az * t[b + 6 * LANES])


@lane
def _distant(t: Array, node: int, state: int, rate: int, forces: Forces) -> None:
    """What Sun, Moon and sunlight add."""
    x, y, z = t[node] + t[state], t[node + LANES] + t[state + LANES], t[node + 2 * LANES] + t[state + 2 * LANES]
    b, m = node + _SUN, node + _MOON
    sx, sy, sz = t[b], t[b + LANES], t[b + 2 * LANES]
    ax, ay, az = third_body(x, y, z, sx, sy, sz, forces.sun * MU_SUN)
    bx, by, bz = third_body(x, y, z, t[m], t[m + LANES], t[m + 2 * LANES], forces.moon * MU_MOON)
    px, py, pz = radiation_pressure(x, y, z, sx, sy, sz, forces.radiation_area)
    t[rate + 3 * LANES] += ax + bx + px
    t[rate + 4 * LANES] += ay + by + py
    t[rate + 5 * LANES] += az + bz + pz


@lane
def _to_inertial(t: Array, i: int, node: int, turning: int) -> None:
    """LVLH state to position and velocity relative to the leader along inertial axes: v = rho' + omega x rho."""
    s, b, q = f.TRUTH + i, node + _AXES + i, f.RELATIVE + i
    x, y, z = t[s], t[s + LANES], t[s + 2 * LANES]
    wx, wz = t[turning + i], t[turning + LANES + i]
    u = t[s + 3 * LANES] - wz * y
    v = t[s + 4 * LANES] + wz * x - wx * z
    w = t[s + 5 * LANES] + wx * y
    for k in range(3):
        e = b + k * LANES
        t[q + k * LANES] = x * t[e] + y * t[e + 3 * LANES] + z * t[e + 6 * LANES]
        t[q + (3 + k) * LANES] = u * t[e] + v * t[e + 3 * LANES] + w * t[e + 6 * LANES]


@lane
def _to_lvlh(t: Array, i: int, node: int, turning: int) -> None:
    """The way back: rho' = v - omega x rho."""
    s, b, q = f.TRUTH + i, node + _AXES + i, f.RELATIVE + i
    for k in range(3):
        e = b + 3 * k * LANES
        t[s + k * LANES] = t[q] * t[e] + t[q + LANES] * t[e + LANES] + t[q + 2 * LANES] * t[e + 2 * LANES]
        t[s + (3 + k) * LANES] = (
            t[q + 3 * LANES] * t[e] + t[q + 4 * LANES] * t[e + LANES] + t[q + 5 * LANES] * t[e + 2 * LANES]
        )
    x, y, z = t[s], t[s + LANES], t[s + 2 * LANES]
    wx, wz = t[turning + i], t[turning + LANES + i]
    t[s + 3 * LANES] += wz * y
    t[s + 4 * LANES] -= wz * x - wx * z
    t[s + 5 * LANES] -= wx * y
