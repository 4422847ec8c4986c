"""The nonlinear truth: leader and follower in the inertial frame (ECI), each under the same forces.

The leader does not depend on the follower, so its path is a table, made before the flight. What is integrated then is
the follower's position relative to the leader along inertial axes, r = r_follower - r_leader, by

    r'' = a(r_leader + r) - a(r_leader) + thrust,

which is the difference of two equations in ECI without the loss of digits in the difference of their solutions.
LVLH is the frame that truly rotates with the leader, at omega = [r a_h / h, 0, h / r^2].
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital import accelerations
from formation_env.orbital.atmosphere import exponential_density_kg_m3
from formation_env.orbital.constants import MU_MOON, MU_SUN, R_EARTH
from formation_env.orbital.elements import to_cartesian
from formation_env.orbital.frames import eci_to_lvlh, lvlh_axes, lvlh_frame, lvlh_to_eci
from formation_env.orbital.orbit import Orbit

TOLERANCE: Final = 1e-12
"""Relative error of the leader's path per step of its integration."""

NODES: Final = (0.0, 1 / 3, 1 / 2, 2 / 3)
"""Instants within a substep at which the leader is needed, and the next substep's first."""
FIELDS: Final = {"position": 0, "velocity": 3, "acceleration": 6, "x_axis": 9, "y_axis": 12, "z_axis": 15}
"""Where a node of the leader's table has which vector, all along ECI."""
FAR_FIELDS: Final = {"sun": 18, "moon": 21}
"""What follows if Sun or Moon matter."""
NEAR_WIDTH: Final = 3 * len(FIELDS)
FAR_WIDTH: Final = NEAR_WIDTH + 3 * len(FAR_FIELDS)
MAX_SUBSTEP_S: Final = 60.0


@dataclass(frozen=True)
class World:
    """What the nonlinear truth is made of.

    Attributes:
        orbit: the leader's osculating orbit at t = 0.
        perturbations: what acts beside gravity.
    """

    orbit: Orbit
    perturbations: Perturbations

    def density_kg_m3(self, position: Array, craft: Spacecraft) -> Array:
        """Density of the air (...) at positions (..., 3); a spacecraft states it for the leader's altitude."""
        altitude_m = np.linalg.norm(position, axis=-1) - R_EARTH
        scale_m = self.perturbations.scale_height_m or np.inf
        return exponential_density_kg_m3(altitude_m, craft.air_density_kg_m3, self.orbit.altitude_m, scale_m)

    def sun_and_moon(self, times_s: Any) -> tuple[Array, Array]:
        """Their positions (..., 3) at times (...), m."""
        from formation_env.orbital.ephemeris import moon_position_m, sun_position_m  # ERFA is slow to import

        epoch = self.perturbations.epoch_jd
        return sun_position_m(epoch, times_s), moon_position_m(epoch, times_s)

    def acceleration(self, times_s: Any, position: Array, velocity: Array, craft: Spacecraft) -> Array:
        """Acceleration (..., 3) of a spacecraft at times (...), m/s^2.

        Args:
            times_s: times (...), s.
            position: ECI (..., 3), m.
            velocity: ECI (..., 3), m/s.
            craft: its drag and its area.
        """
        (x, y, z), (vx, vy, vz), on = np.moveaxis(position, -1, 0), np.moveaxis(velocity, -1, 0), self.perturbations
        parts = [accelerations.gravity(x, y, z, self.orbit.j2_coefficient)]
        if on.drag:
            density = self.density_kg_m3(position, craft)
            parts.append(accelerations.drag(vx, vy, vz, density, craft.drag_area_per_mass_m2_kg))
        if on.far_bodies:
            (sx, sy, sz), (mx, my, mz) = (np.moveaxis(body, -1, 0) for body in self.sun_and_moon(times_s))
            parts.append(accelerations.third_body(x, y, z, sx, sy, sz, MU_SUN * on.sun))
            parts.append(accelerations.third_body(x, y, z, mx, my, mz, MU_MOON * on.moon))
            area = craft.radiation_area_per_mass_m2_kg * on.radiation_pressure
            parts.append(accelerations.radiation_pressure(x, y, z, sx, sy, sz, area))
        return np.moveaxis(np.array(parts).sum(axis=0), 0, -1)


def coast(world: World, craft: Spacecraft, states: Array, times_s: Array) -> Array:
    """Fly without thrust in ECI (Dormand & Prince's method of order 8).

    Args:
        world: what acts.
        craft: the spacecraft.
        states: positions and velocities (N, 6) at t = 0, m and m/s.
        times_s: times (T,), s, all of one sign and sorted away from 0.

    Returns:
        States (T, N, 6).
    """
    from scipy.integrate import solve_ivp  # slow to import, and linear truths do without it

    def rates(time_s: float, y: Array) -> Array:
        position, velocity = np.split(y.reshape(-1, 6), 2, axis=1)
        return np.hstack([velocity, world.acceleration(time_s, position, velocity, craft)]).ravel()

    if times_s[-1] == 0:
        return np.broadcast_to(states, (len(times_s), *states.shape))
    span = (0.0, float(times_s[-1]))
    solution = solve_ivp(rates, span, states.ravel(), "DOP853", times_s, rtol=TOLERANCE, atol=1e-9)
    return np.asarray(solution.y.T).reshape(len(times_s), -1, 6)


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
    states = coast(world, craft, np.concatenate(to_cartesian(world.orbit.elements))[None], times_s)
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
    flown = coast(world, follower, inertial, times_s)
    leaders = (part[:, None] for part in path.motion)
    return np.concatenate(eci_to_lvlh(flown[..., :3], flown[..., 3:], *leaders), axis=-1)


def substeps(dt_s: float) -> int:
    """Integration steps per control step."""
    return int(np.ceil(dt_s / MAX_SUBSTEP_S))


@lru_cache(maxsize=4)
def leader_table(world: World, craft: Spacecraft, dt_s: float, num_steps: int) -> Array:
    """What the compiled step needs to know of the leader, one row for each step (num_steps, width).

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
