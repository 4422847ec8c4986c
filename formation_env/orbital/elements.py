"""Classical orbital elements and Cartesian states (Ma 2009, section 2.2.3); `kepler` has the anomalies.

All functions work on arrays of any leading shape (...). Orbits are elliptic: 0 <= e < 1.
Legend: nu true anomaly, u = argument of perigee + nu, p = a (1 - e^2), n mean motion, h angular momentum.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from formation_env.orbital.constants import J2, MU_EARTH, R_EARTH
from formation_env.orbital.kepler import Array, elliptic

Values: TypeAlias = float | Array

UNDEFINED = 1e-13
"""Eccentricities and sines of the inclination below this are rounding, and the angles that hang on them undefined."""


class Elements(NamedTuple):
    """Osculating classical elements of an elliptic orbit; each field is a number or an array (...).

    Attributes:
        semi_major_axis_m: a, m.
        eccentricity: e, in [0, 1).
        inclination_rad: i, in [0, pi], rad.
        raan_rad: right ascension of the ascending node, rad.
        arg_perigee_rad: argument of perigee, rad.
        true_anomaly_rad: nu, rad.
    """

    semi_major_axis_m: Values
    eccentricity: Values
    inclination_rad: Values
    raan_rad: Values
    arg_perigee_rad: Values
    true_anomaly_rad: Values


class SecularRates(NamedTuple):
    """Mean rates of the angles under J2, rad/s.

    Attributes:
        raan_rad_s: of the right ascension of the ascending node.
        arg_perigee_rad_s: of the argument of perigee.
        mean_anomaly_rad_s: of the mean anomaly.
    """

    raan_rad_s: Array
    arg_perigee_rad_s: Array
    mean_anomaly_rad_s: Array


def to_cartesian(elements: Elements) -> tuple[Array, Array]:
    """ECI position and velocity of a point on its orbit (Vallado 2013, algorithm 10).

    Args:
        elements: with fields that broadcast to (...).

    Returns:
        Position (..., 3), m, and velocity (..., 3), m/s.

    Raises:
        ValueError: an eccentricity outside [0, 1).
    """
    a, e, _, _, _, nu = np.broadcast_arrays(*elements)
    p = a * (1 - elliptic(e) ** 2)
    along, across, _ = np.moveaxis(orbital_axes(elements), -2, 0)
    cos, sin = np.cos(nu)[..., None], np.sin(nu)[..., None]
    position: Array = (p / (1 + e * np.cos(nu)))[..., None] * (cos * along + sin * across)
    velocity: Array = np.sqrt(MU_EARTH / p)[..., None] * (-sin * along + (e[..., None] + cos) * across)
    return position, velocity


def to_elements(position_m: ArrayLike, velocity_m_s: ArrayLike) -> Elements:
    """Osculating elements of an ECI state (Vallado 2013, algorithm 9); angles in [0, 2 pi).

    Undefined angles are 0 and the next one takes over. Circular: the argument of perigee is 0, and the true anomaly
    counts from the ascending node. Equatorial: the node is 0, and the argument of perigee counts from the ECI x axis
    in the sense of the motion. Both: the true anomaly counts from the x axis.

    Args:
        position_m: ECI position (..., 3), m.
        velocity_m_s: ECI velocity (..., 3), m/s.

    Returns:
        Elements with fields of shape (...).

    Raises:
        ValueError: a state that is not on an ellipse: unbound, or falling straight down.
    """
    position, velocity = np.asarray(position_m, float), np.asarray(velocity_m_s, float)
    momentum, radius = np.cross(position, velocity), np.linalg.norm(position, axis=-1)
    h = np.linalg.norm(momentum, axis=-1)
    # vis-viva: v^2 = mu (2/r - 1/a)
    inverse_axis = 2 / radius - np.sum(velocity**2, axis=-1) / MU_EARTH
    if not (np.all(inverse_axis > 0) and np.all(h > 0)):
        raise ValueError("position_m, velocity_m_s: must be on an elliptic orbit, got one that is unbound or straight")
    perigee = np.cross(velocity, momentum) / MU_EARTH - position / radius[..., None]
    e = np.linalg.norm(perigee, axis=-1)
    node, across = _node_axes(momentum / h[..., None])
    raan = np.arctan2(node[..., 1], node[..., 0])
    arg_perigee = np.where(e > UNDEFINED, _angle(perigee, node, across), 0.0)
    nu = _angle(position, node, across) - arg_perigee
    inclination = np.arctan2(np.hypot(momentum[..., 0], momentum[..., 1]), momentum[..., 2])
    return Elements(1 / inverse_axis, e, inclination, *(_positive(angle) for angle in (raan, arg_perigee, nu)))


def orbital_axes(elements: Elements) -> Array:
    """Unit vectors of the orbital (perifocal) frame in ECI: to perigee, along the motion there, along the normal.

    Args:
        elements: of which only the three orientation angles are used.

    Returns:
        Rows are the axes (..., 3, 3): the matrix takes ECI vectors to the orbital frame.
    """
    _, _, i, raan, arg_perigee, _ = np.broadcast_arrays(*elements)
    zero = np.zeros(i.shape)
    node = np.stack([np.cos(raan), np.sin(raan), zero], axis=-1)
    normal = np.stack([np.sin(i) * np.sin(raan), -np.sin(i) * np.cos(raan), np.cos(i)], axis=-1)
    quarter = np.cross(normal, node)
    cos, sin = np.cos(arg_perigee)[..., None], np.sin(arg_perigee)[..., None]
    return np.stack([cos * node + sin * quarter, -sin * node + cos * quarter, normal], axis=-2)


def secular_rates(
    semi_major_axis_m: ArrayLike, eccentricity: ArrayLike, inclination_rad: ArrayLike, j2: float = J2
) -> SecularRates:
    """Mean rates of the angles by first-order theory (Ma 2009, eq. 2.25-2.27; factors by Vallado 2013, section 9.6).

    Args:
        semi_major_axis_m: mean a (...), m.
        eccentricity: mean e (...), in [0, 1).
        inclination_rad: mean i (...), rad.
        j2: second zonal harmonic; 0 leaves Kepler's motion.
    """
    a, e = np.asarray(semi_major_axis_m, float), elliptic(eccentricity)
    sin2 = np.sin(inclination_rad) ** 2
    n, p = np.sqrt(MU_EARTH / a**3), a * (1 - e**2)
    q = n * j2 * (R_EARTH / p) ** 2
    # RAAN' = -3/2 q cos i, argp' = 3/4 q (4 - 5 sin^2 i), M' = n + 3/4 q sqrt(1 - e^2) (2 - 3 sin^2 i)
    return SecularRates(
        raan_rad_s=-1.5 * q * np.cos(inclination_rad),
        arg_perigee_rad_s=0.75 * q * (4 - 5 * sin2),
        mean_anomaly_rad_s=n + 0.75 * q * np.sqrt(1 - e**2) * (2 - 3 * sin2),
    )


def mean_radius_m(
    semi_major_axis_m: ArrayLike, inclination_rad: ArrayLike, argument_of_latitude_rad: ArrayLike, j2: float = J2
) -> Array:
    """Mean radius under J2 of an orbit whose osculating elements are circular at one instant (Brouwer 1959, order J2).

    At this radius n c of Schweighart & Sedwick (2002) is the mean rate of the orbit, argp' + M' + RAAN' cos i.

    Args:
        semi_major_axis_m: osculating a (...) at that instant, m.
        inclination_rad: i (...), rad.
        argument_of_latitude_rad: u (...) at that instant, rad.
        j2: second zonal harmonic; 0 gives a.
    """
    a, i = np.asarray(semi_major_axis_m, float), np.asarray(inclination_rad, float)
    q = j2 * R_EARTH**2 / a
    # a_mean = a - 3/2 q sin^2 i cos 2u, r_mean = a_mean + 3/4 q (1 - 3 cos^2 i)
    a_mean = a - 1.5 * q * np.sin(i) ** 2 * np.cos(2 * np.asarray(argument_of_latitude_rad, float))
    r_mean: Array = a_mean + 0.75 * q * (1 - 3 * np.cos(i) ** 2)
    return r_mean


def unit(vector: Array) -> Array:
    """Vectors (..., 3) of length one along given ones."""
    direction: Array = vector / np.linalg.norm(vector, axis=-1, keepdims=True)
    return direction


def _node_axes(normal: Array) -> tuple[Array, Array]:
    """Unit vectors in the orbit plane: to the ascending node (to x if there is none), and a quarter turn on."""
    sine = np.hypot(normal[..., 0], normal[..., 1])
    equatorial = sine < UNDEFINED
    line = np.stack([-normal[..., 1], normal[..., 0], np.zeros_like(sine)], axis=-1)
    node = np.where(equatorial[..., None], [1.0, 0.0, 0.0], line / np.where(equatorial, 1.0, sine)[..., None])
    return node, np.cross(normal, node)


def _angle(vector: Array, first: Array, second: Array) -> Array:
    """Angle of a vector in the plane of two unit vectors, counted from the first, rad."""
    angle: Array = np.arctan2(np.sum(vector * second, axis=-1), np.sum(vector * first, axis=-1))
    return angle


def _positive(angle_rad: Array) -> Array:
    """The angle in [0, 2 pi); a remainder of a tiny negative angle rounds to 2 pi, which is 0."""
    turned = np.remainder(angle_rad, 2 * np.pi)
    return np.where(turned == 2 * np.pi, 0.0, turned)
