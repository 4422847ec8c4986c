"""The nonlinear truth: leader and follower in the inertial frame (ECI), each under the same forces.

The leader does not depend on the follower, so its path is a table, made before the flight. The step integrates
the follower's position relative to the leader along inertial axes, r = r_follower - r_leader, by

    r'' = a(r_leader + r) - a(r_leader) + thrust,

which is the difference of two equations in ECI without the loss of digits in the difference of their solutions.
LVLH is the frame that truly rotates with the leader, at omega = [r a_h / h, 0, h / r^2].
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from formation_env.dynamics.coasting import coast
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.world import World
from formation_env.numerics.arrays import Array
from formation_env.orbital.elements import to_cartesian
from formation_env.orbital.frames import eci_to_lvlh, lvlh_axes, lvlh_frame, lvlh_to_eci

NODES: Final = (0.0, 1 / 3, 1 / 2, 2 / 3)
"""Instants within a substep at which the leader is needed, and the next substep's first."""
FIELDS: Final = {"position": 0, "velocity": 3, "acceleration": 6, "x_axis": 9, "y_axis": 12, "z_axis": 15}
"""Offsets of the vectors in a node of the leader's table, all along ECI."""
FAR_FIELDS: Final = {"sun": 18, "moon": 21}
"""Further vectors of a node if the Sun or the Moon acts."""
NEAR_WIDTH: Final = 3 * len(FIELDS)
FAR_WIDTH: Final = NEAR_WIDTH + 3 * len(FAR_FIELDS)
MAX_SUBSTEP_S: Final = 60.0


@dataclass(frozen=True)
class Leader:
    """The leader at some instants.

    Attributes:
        position: ECI (T, 3), m.
        velocity: ECI (T, 3), m/s.
        acceleration: ECI (T, 3), m/s^2.
        normal_accel: its part along the orbit normal (T,), m/s^2.
        axes: LVLH axes along ECI (T, 3, 3): row 0 is x, row 1 y, row 2 z.
        rotation: LVLH's angular velocity along LVLH (T, 3), rad/s.
    """

    position: Array
    velocity: Array
    acceleration: Array
    normal_accel: Array
    axes: Array
    rotation: Array

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Position, velocity, and acceleration along the orbit normal (T,): what the frames need."""
        return self.position, self.velocity, self.normal_accel


def leader_path(world: World, craft: Spacecraft, times_s: Array) -> Leader:
    """The leader at times (T,), s, all of one sign and sorted away from 0."""
    states = coast(world, craft, np.concatenate(to_cartesian(world.orbit.elements))[None], times_s, who="leader")
    position, velocity = np.split(states[:, 0], 2, axis=1)
    acceleration = world.acceleration(times_s, position, velocity, craft)
    normal_accel = np.vecdot(acceleration, lvlh_axes(position, velocity)[:, 2])
    axes, rotation = lvlh_frame(position, velocity, normal_accel)
    return Leader(position, velocity, acceleration, normal_accel, axes, rotation)


def relative_path(world: World, follower: Spacecraft, leader: Spacecraft, states: Array, times_s: Array) -> Array:
    """Followers that do not thrust.

    Args:
        world: what acts.
        follower: each follower.
        leader: the leader.
        states: LVLH states (N, 6) at t = 0, m and m/s.
        times_s: times (T,), s, all of one sign and sorted away from 0.

    Returns:
        LVLH states (T, N, 6).
    """
    start, path = leader_path(world, leader, np.zeros(1)), leader_path(world, leader, times_s)
    inertial = np.hstack(lvlh_to_eci(states[:, :3], states[:, 3:], *start.motion))
    flown = coast(world, follower, inertial, times_s, who="follower")
    leaders = (part[:, None] for part in path.motion)
    return np.concatenate(eci_to_lvlh(flown[..., :3], flown[..., 3:], *leaders), axis=-1)


def substeps(dt_s: float) -> int:
    """Integration steps per control step."""
    return int(np.ceil(dt_s / MAX_SUBSTEP_S))


@lru_cache(maxsize=4)
def leader_table(world: World, craft: Spacecraft, dt_s: float, num_steps: int) -> Array:
    """Table of the leader for the compiled step, one row for each step (num_steps, width).

    A row has the leader at `NODES` of each substep and at the end, `FIELDS` (and `FAR_FIELDS`) at each; then LVLH's
    angular velocity about x and z at the step's start and at its end.
    """
    count = substeps(dt_s)
    shares = (np.arange(num_steps * count)[:, None] + np.array(NODES)).ravel() / count
    times_s = dt_s * np.append(shares, num_steps)
    leader = leader_path(world, craft, times_s)
    columns = [leader.position, leader.velocity, leader.acceleration, leader.axes.reshape(-1, 9)]
    if world.perturbations.far_bodies:
        columns += world.sun_and_moon(times_s)
    nodes = np.hstack(columns)
    per_step = len(NODES) * count
    rows = np.lib.stride_tricks.sliding_window_view(nodes, per_step + 1, axis=0)[::per_step]
    turning = leader.rotation[::per_step, [0, 2]]
    table = np.hstack([rows.transpose(0, 2, 1).reshape(num_steps, -1), turning[:-1], turning[1:]])
    table.setflags(write=False)
    return table
