"""Gauss's variational equations: how a force changes the orbital elements (Ma 2009, appendix A).

Legend: f_x, f_y, f_z perturbing acceleration along LVLH radial, along-track and normal axes; nu true anomaly,
u = argument of perigee + nu, p = a (1 - e^2), n mean motion, h angular momentum.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from formation_env.numerics.integration import IntegrationError, integrate
from formation_env.orbital.constants import MU_EARTH
from formation_env.orbital.elements import UNDEFINED, Elements, to_cartesian, to_elements, unit
from formation_env.orbital.kepler import Array, elliptic

Perturbation: TypeAlias = Callable[[float, Array, Array], ArrayLike]
"""Time, s, ECI position (..., 3), m, and velocity (..., 3), m/s -> ECI acceleration (..., 3), m/s^2."""


class ElementRates(NamedTuple):
    """Rates of change of the elements, arrays (...).

    Attributes:
        semi_major_axis_m_s: da/dt, m/s.
        eccentricity_per_s: de/dt, 1/s.
        inclination_rad_s: di/dt, rad/s.
        raan_rad_s: of the right ascension of the ascending node, rad/s.
        arg_perigee_rad_s: of the argument of perigee, rad/s.
        mean_anomaly_rad_s: dM/dt, rad/s; n without perturbation.
    """

    semi_major_axis_m_s: Array
    eccentricity_per_s: Array
    inclination_rad_s: Array
    raan_rad_s: Array
    arg_perigee_rad_s: Array
    mean_anomaly_rad_s: Array


def element_rates(elements: Elements, lvlh_accel_m_s2: ArrayLike) -> ElementRates:
    """Rates of the classical elements under a perturbing acceleration (Ma 2009, eq. A.1-A.6; Vallado 2013, eq. 9-24).

    Args:
        elements: with fields that broadcast to (...); neither circular nor equatorial, see `elements.UNDEFINED`.
        lvlh_accel_m_s2: perturbing acceleration (..., 3), radial, along-track and normal, m/s^2.

    Raises:
        ValueError: e outside (0, 1) or an equatorial orbit, where classical elements have no rates;
            `propagate_elements` works there too.
    """
    a, e, i, _, arg_perigee, nu = np.broadcast_arrays(*elements)
    if not (np.all(elliptic(e) > UNDEFINED) and np.all(np.abs(np.sin(i)) > UNDEFINED)):
        raise ValueError("elements: a circular or equatorial orbit has no rates of its classical elements")
    fx, fy, fz = np.moveaxis(np.asarray(lvlh_accel_m_s2, float), -1, 0)
    n, root, cos, sin = np.sqrt(MU_EARTH / a**3), np.sqrt(1 - e**2), np.cos(nu), np.sin(nu)
    swell = 1 + e * cos  # p / r
    r = a * root**2 / swell
    # di/dt = r cos u f_z / (n a^2 sqrt(1 - e^2)), dRAAN/dt = r sin u f_z / (n a^2 sqrt(1 - e^2) sin i)
    tilt = r * fz / (n * a**2 * root)
    raan_rate = tilt * np.sin(arg_perigee + nu) / np.sin(i)
    return ElementRates(
        # da/dt = 2 / (n sqrt(1 - e^2)) [f_x e sin nu + f_y (1 + e cos nu)]
        semi_major_axis_m_s=2 / (n * root) * (fx * e * sin + fy * swell),
        # de/dt = sqrt(1 - e^2) / (n a) [f_x sin nu + f_y (cos E + cos nu)], cos E = (e + cos nu) / (1 + e cos nu)
        eccentricity_per_s=root / (n * a) * (fx * sin + fy * ((e + cos) / swell + cos)),
        inclination_rad_s=tilt * np.cos(arg_perigee + nu),
        raan_rad_s=raan_rate,
        # dargp/dt = sqrt(1 - e^2) / (n a e) [-f_x cos nu + f_y (2 + e cos nu) / (1 + e cos nu) sin nu] - cos i dRAAN/dt
        arg_perigee_rad_s=root / (n * a * e) * (-fx * cos + fy * (1 + 1 / swell) * sin) - np.cos(i) * raan_rate,
        # dM/dt = n - (1 - e^2) / (n a e) [f_x (2 e r/p - cos nu) + f_y (1 + r/p) sin nu]
        mean_anomaly_rad_s=n - root**2 / (n * a * e) * (fx * (2 * e / swell - cos) + fy * (1 + 1 / swell) * sin),
    )


def propagate_elements(
    elements: Elements, times_s: ArrayLike, perturbation: Perturbation, *, rtol: float = 1e-11
) -> Elements:
    """Osculating elements over time under a perturbing force, by Gauss's equations in vector form.

    The state is the angular momentum, the eccentricity vector and the radial direction (Battin 1999, section 10.2;
    Rosengren & Scheeres 2014), of which nothing is singular on circular or equatorial orbits. Without perturbation
    only the direction moves.

    Args:
        elements: at the first time, with fields that broadcast to (...).
        times_s: increasing times (T,), s.
        perturbation: the acceleration beside the central one.
        rtol: relative tolerance of the integrator.

    Returns:
        Elements with fields of shape (..., T).

    Raises:
        ValueError: times that do not increase, an eccentricity outside [0, 1), at the start or on the way, or a force
            that is not finite or so strong that the motion cannot be integrated.
    """
    times = np.asarray(times_s, float)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ValueError(f"times_s: must be finite and increasing with shape (T,), got {times}")
    position, velocity = to_cartesian(elements)
    start = _vectors(position, velocity)

    def rates(time_s: float, state: Array) -> Array:
        return _vector_rates(state.reshape(start.shape), time_s, perturbation).ravel()

    # each vector is known to rtol of its own length; the eccentricity vector's scale is one
    scale = np.broadcast_to(np.linalg.norm(start, axis=-1, keepdims=True), start.shape).copy()
    scale[1] = 1.0
    shortest_m = float(np.min(elements.semi_major_axis_m, initial=np.inf))
    try:
        flight = integrate(
            rates,
            start.ravel(),
            times,
            start_s=float(times[0]) if len(times) else 0.0,
            period_s=2 * np.pi * np.sqrt(shortest_m**3 / MU_EARTH),
            rtol=rtol,
            atol=(rtol * scale).ravel(),
        )
    except IntegrationError as error:
        raise ValueError(f"perturbation: the motion cannot be integrated: {error}") from None
    path: Array = np.moveaxis(flight.T.reshape(*start.shape, len(times)), -1, -2)
    return to_elements(*_cartesian(path))


def _vectors(position: Array, velocity: Array) -> Array:
    """Angular momentum, eccentricity vector and radial direction (3, ..., 3)."""
    h = np.cross(position, velocity)
    direction = unit(position)
    return np.stack([h, np.cross(velocity, h) / MU_EARTH - direction, direction])


def _cartesian(vectors: Array) -> tuple[Array, Array]:
    """Position and velocity (..., 3) of the vectors (3, ..., 3)."""
    h, e, direction = vectors
    direction = unit(direction)  # the integrator leaves its length to its tolerance
    p = np.sum(h**2, axis=-1, keepdims=True) / MU_EARTH
    # r = p / (1 + e . u) u, v = h x (e + u) / p
    return p / (1 + np.sum(e * direction, axis=-1, keepdims=True)) * direction, np.cross(h, e + direction) / p


def _vector_rates(vectors: Array, time_s: float, perturbation: Perturbation) -> Array:
    """Rates (3, ..., 3) of the vectors."""
    h, _, direction = vectors
    position, velocity = _cartesian(vectors)
    f = np.asarray(perturbation(time_s, position, velocity), float)
    h_rate = np.cross(position, f)
    # de/dt = (f x h + v x dh/dt) / mu
    e_rate = (np.cross(f, h) + np.cross(velocity, h_rate)) / MU_EARTH
    # du/dt = (h / r^2 + r f_z / h u) x u: the orbit plane tilts about u itself, so only the turn in the plane moves u
    radius = np.sum(position * direction, axis=-1, keepdims=True)
    return np.stack([h_rate, e_rate, np.cross(h, direction) / radius**2])
