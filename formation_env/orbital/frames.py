"""Reference frames: inertial, Earth-fixed, Earth-spherical, orbital and LVLH (Ma 2009, section 2.1).

Positions and velocities are (..., 3), m and m/s; leading shapes broadcast. ECI: x to the vernal equinox, z along the
Earth's axis. A velocity is the rate of change of that frame's coordinates, so rotating frames subtract their own turn.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from formation_env.orbital.constants import OMEGA_EARTH
from formation_env.orbital.elements import Elements, orbital_axes, unit
from formation_env.orbital.kepler import Array

State: TypeAlias = tuple[Array, Array]
"""Position (..., 3), m, and velocity (..., 3), m/s."""


def eci_to_lvlh(
    position: ArrayLike,
    velocity: ArrayLike,
    leader_position: ArrayLike,
    leader_velocity: ArrayLike,
    normal_accel_m_s2: ArrayLike = 0.0,
) -> State:
    """State relative to a leader on any orbit, in the frame that turns with it (Ma 2009, section 2.1.5).

    Args:
        position: ECI position (..., 3), m.
        velocity: ECI velocity (..., 3), m/s.
        leader_position: the leader's, m.
        leader_velocity: the leader's, m/s.
        normal_accel_m_s2: the leader's acceleration along its orbit normal (...), m/s^2; 0 for two bodies.

    Returns:
        Position x radial (outward), y along-track, z along the orbit normal, and its rate.
    """
    axes, omega = lvlh_frame(leader_position, leader_velocity, normal_accel_m_s2)
    relative = _apply(axes, np.subtract(position, leader_position))
    rate = _apply(axes, np.subtract(velocity, leader_velocity))
    return relative, rate - np.cross(omega, relative)


def lvlh_to_eci(
    relative_position: ArrayLike,
    relative_velocity: ArrayLike,
    leader_position: ArrayLike,
    leader_velocity: ArrayLike,
    normal_accel_m_s2: ArrayLike = 0.0,
) -> State:
    """Inertial state of a follower: the inverse of `eci_to_lvlh`.

    Args:
        relative_position: LVLH position (..., 3), m.
        relative_velocity: its rate in the rotating frame (..., 3), m/s.
        leader_position: ECI, m.
        leader_velocity: ECI, m/s.
        normal_accel_m_s2: the leader's acceleration along its orbit normal (...), m/s^2; 0 for two bodies.
    """
    axes, omega = lvlh_frame(leader_position, leader_velocity, normal_accel_m_s2)
    relative = np.asarray(relative_position, float)
    rate = np.add(relative_velocity, np.cross(omega, relative))
    return np.add(leader_position, _undo(axes, relative)), np.add(leader_velocity, _undo(axes, rate))


def lvlh_axes(position: ArrayLike, velocity: ArrayLike) -> Array:
    """Unit vectors radial, along-track and normal of an orbit in ECI.

    Returns:
        Rows are the axes (..., 3, 3): the matrix takes ECI vectors to LVLH.
    """
    r = np.asarray(position, float)
    radial, normal = unit(r), unit(np.cross(r, np.asarray(velocity, float)))
    return np.stack([radial, np.cross(normal, radial), normal], axis=-2)


def eci_to_earth_fixed(position: ArrayLike, velocity: ArrayLike, time_s: ArrayLike, angle_rad: float = 0.0) -> State:
    """State in the frame that turns with the Earth (Ma 2009, section 2.1.3).

    Args:
        position: ECI position (..., 3), m.
        velocity: ECI velocity (..., 3), m/s.
        time_s: times (...), s.
        angle_rad: the Earth's angle from the vernal equinox to Greenwich at t = 0, rad.
    """
    axes = _earth_axes(time_s, angle_rad)
    fixed = _apply(axes, position)
    return fixed, _apply(axes, velocity) - np.cross([0.0, 0.0, OMEGA_EARTH], fixed)


def earth_fixed_to_eci(position: ArrayLike, velocity: ArrayLike, time_s: ArrayLike, angle_rad: float = 0.0) -> State:
    """Inertial state: the inverse of `eci_to_earth_fixed`, with the same arguments."""
    axes, fixed = _earth_axes(time_s, angle_rad), np.asarray(position, float)
    return _undo(axes, fixed), _undo(axes, np.add(velocity, np.cross([0.0, 0.0, OMEGA_EARTH], fixed)))


def cartesian_to_spherical(position: ArrayLike, velocity: ArrayLike) -> State:
    """Earth-spherical coordinates and their rates (Ma 2009, section 2.1.2, eq. 2.13).

    Args:
        position: in ECI or Earth-fixed axes (..., 3), m.
        velocity: in the same axes (..., 3), m/s.

    Returns:
        Radius, m; right ascension (in ECI) or longitude (Earth-fixed) in (-pi, pi], rad; declination or latitude, rad,
        as (..., 3), and their rates, m/s and rad/s.

    Raises:
        ValueError: a position on the polar axis, where longitude has no rate.
    """
    (x, y, z), (vx, vy, vz) = (np.moveaxis(np.asarray(vector, float), -1, 0) for vector in (position, velocity))
    across = np.hypot(x, y)
    if not np.all(across > 0):
        raise ValueError("position: must be off the polar axis, where longitude has no rate")
    radius = np.hypot(across, z)
    outward = (x * vx + y * vy) / across
    coordinates = [radius, np.arctan2(y, x), np.arctan2(z, across)]
    rates = [
        (across * outward + z * vz) / radius,
        (x * vy - y * vx) / across**2,
        (across * vz - z * outward) / radius**2,
    ]
    return np.stack(coordinates, axis=-1), np.stack(rates, axis=-1)


def spherical_to_cartesian(coordinates: ArrayLike, rates: ArrayLike) -> State:
    """Cartesian state: the inverse of `cartesian_to_spherical` (Ma 2009, eq. 2.13).

    Args:
        coordinates: radius, longitude, latitude (..., 3), m and rad.
        rates: theirs (..., 3), m/s and rad/s.
    """
    vectors = np.broadcast_arrays(np.asarray(coordinates, float), np.asarray(rates, float))
    (r, theta, phi), (r_rate, theta_rate, phi_rate) = (np.moveaxis(vector, -1, 0) for vector in vectors)
    zero = np.zeros_like(theta)
    # r' = r' u_r + r theta' cos phi u_theta + r phi' u_phi
    up = np.stack([np.cos(phi) * np.cos(theta), np.cos(phi) * np.sin(theta), np.sin(phi)], axis=-1)
    east = np.stack([-np.sin(theta), np.cos(theta), zero], axis=-1)
    north = np.cross(up, east)
    speeds = np.stack([r_rate, r * theta_rate * np.cos(phi), r * phi_rate], axis=-1)
    return r[..., None] * up, _undo(np.stack([up, east, north], axis=-2), speeds)


def eci_to_orbital(position: ArrayLike, velocity: ArrayLike, elements: Elements) -> State:
    """State in the orbital (perifocal) frame of an orbit: x to perigee, z along the normal (Ma 2009, section 2.1.4).

    Args:
        position: ECI position (..., 3), m.
        velocity: ECI velocity (..., 3), m/s.
        elements: of which only the three orientation angles are used.
    """
    axes = orbital_axes(elements)
    return _apply(axes, position), _apply(axes, velocity)


def orbital_to_eci(position: ArrayLike, velocity: ArrayLike, elements: Elements) -> State:
    """Inertial state: the inverse of `eci_to_orbital`, with the same arguments."""
    axes = orbital_axes(elements)
    return _undo(axes, position), _undo(axes, velocity)


def lvlh_frame(position: ArrayLike, velocity: ArrayLike, normal_accel: ArrayLike) -> tuple[Array, Array]:
    """LVLH axes (..., 3, 3) of a leader and their angular velocity (..., 3) in LVLH, rad/s."""
    momentum = np.cross(np.asarray(position, float), np.asarray(velocity, float))
    r, h = np.linalg.norm(position, axis=-1), np.linalg.norm(momentum, axis=-1)
    # omega = [r a_h / h, 0, h / r^2]: a force along the normal tilts the orbit plane about the radius
    tilt = r * np.asarray(normal_accel, float) / h
    turn = np.broadcast_to(h / r**2, tilt.shape)
    return lvlh_axes(position, velocity), np.stack([tilt, np.zeros_like(tilt), turn], axis=-1)


def _earth_axes(time_s: ArrayLike, angle_rad: float) -> Array:
    """Rows are the Earth-fixed axes in ECI (..., 3, 3)."""
    angle = angle_rad + OMEGA_EARTH * np.asarray(time_s, float)
    cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    rows = [[cos, sin, zero], [-sin, cos, zero], [zero, zero, zero + 1]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _apply(axes: Array, vector: ArrayLike) -> Array:
    """Components (..., 3) of a vector along the axes."""
    components: Array = np.einsum("...ij,...j->...i", axes, np.asarray(vector, float))
    return components


def _undo(axes: Array, components: ArrayLike) -> Array:
    """The vector (..., 3) of given components along the axes."""
    vector: Array = np.einsum("...ij,...i->...j", axes, np.asarray(components, float))
    return vector
