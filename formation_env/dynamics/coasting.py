"""Flight without thrust in the inertial frame (ECI)."""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.world import World
from formation_env.numerics.arrays import Array
from formation_env.numerics.integration import IntegrationError, integrate
from formation_env.orbital.constants import MU_EARTH, R_EARTH
from formation_env.orbital.elements import to_cartesian

TOLERANCE: Final = 1e-12
"""Relative error of the leader's path per step of its integration."""
ABSOLUTE_TOLERANCE: Final = 1e-9
"""Absolute error of the same, m and m/s."""
REENTRY_MARGIN: Final = 1.01
"""The last state before an integration stops at re-entry is up to one step above that altitude."""
REENTRY_ALTITUDE_M: Final = 80e3
"""Altitude at which spacecraft break up; below it no orbit lasts a revolution."""
OSCILLATION_M: Final = 20e3
"""Depth below the osculating perigee that the Earth's oblateness may bring within a revolution, m, generously."""


def coast(world: World, craft: Spacecraft, states: Array, times_s: Array, *, who: str) -> Array:
    """Fly without thrust in ECI.

    Args:
        world: what acts.
        craft: the spacecraft.
        states: positions and velocities (N, 6) at t = 0, m and m/s.
        times_s: times (T,), s, all of one sign and sorted away from 0.
        who: leader or follower, for the errors.

    Returns:
        States (T, N, 6).

    Raises:
        ValueError: a spacecraft that falls out of its orbit, or motion that cannot be integrated.
    """
    if len(states) == 0:
        return np.zeros((len(times_s), 0, 6))

    def rates(time_s: float, y: Array) -> Array:
        position, velocity = np.split(y.reshape(-1, 6), 2, axis=1)
        return np.hstack([velocity, world.acceleration(time_s, position, velocity, craft)]).ravel()

    def height(_: float, y: Array) -> Array:
        return np.asarray(_altitude_m(y).min() - REENTRY_ALTITUDE_M)

    start = states.ravel()
    if height(0.0, start) <= 0:
        raise ValueError(f"{who}: must start above {REENTRY_ALTITUDE_M:g} m, got {_altitude_m(start).min():.6g} m")
    try:
        flown = integrate(
            rates,
            start,
            times_s,
            start_s=0.0,
            period_s=world.orbit.period_s,
            rtol=TOLERANCE,
            atol=ABSOLUTE_TOLERANCE,
            height=height,
        )
    except IntegrationError as error:
        raise ValueError(_lost(world, craft, error, who)) from None
    return flown.reshape(len(times_s), -1, 6)


def _altitude_m(y: Array) -> Array:
    """Altitudes (N,) above the equatorial radius of states (6 N,), m."""
    altitude: Array = np.linalg.norm(y.reshape(-1, 6)[:, :3], axis=1) - R_EARTH
    return altitude


def _lost(world: World, craft: Spacecraft, error: IntegrationError, who: str) -> str:
    """The one line that says why a flight without thrust ended early."""
    lowest = error.state.reshape(-1, 6)[_altitude_m(error.state).argmin()]
    altitude_m = _altitude_m(lowest)[0]
    if altitude_m <= REENTRY_MARGIN * REENTRY_ALTITUDE_M:
        return (
            f"{who}: re-enters at t = {error.time_s:.6g} s ({error.time_s / world.orbit.period_s:.3g} orbits), when it "
            f"is below {REENTRY_ALTITUDE_M:g} m"
        )
    density, scale_m = world.density_kg_m3(lowest[:3], craft), world.perturbations.scale_height_m
    return (
        f"{who}: its motion cannot be integrated: {error}, at an altitude of {altitude_m:.6g} m, where the air has "
        f"{density:.3g} kg/m^3 by perturbations.scale_height_m = {scale_m} m"
    )


@lru_cache(maxsize=16)
def check_leader_path(world: World, craft: Spacecraft, duration_s: float) -> None:
    """Refuse a leader that does not stay in orbit.

    Where drag takes off less than a tenth of what would matter, nothing is integrated.

    Args:
        world: what acts.
        craft: the leader.
        duration_s: of the flight, s.

    Raises:
        ValueError: the leader re-enters, or its motion cannot be integrated.
    """
    if _sinks(world, craft, duration_s):
        coast(
            world, craft, np.concatenate(to_cartesian(world.orbit.elements))[None], np.array([duration_s]), who="leader"
        )


def _sinks(world: World, craft: Spacecraft, duration_s: float) -> bool:
    """Whether drag could bring a spacecraft down, were it always at the orbit's lowest and fastest point.

    The bound of the sinking is that of a circle's, da/dt = -rho v a C_d S / m, times its greatest on the ellipse.
    """
    if not world.perturbations.drag:
        return False
    e, a = world.orbit.eccentricity, world.orbit.semi_major_axis_m
    perigee_m = a * (1 - e) - OSCILLATION_M
    density = world.density_kg_m3(np.array([perigee_m, 0.0, 0.0]), craft)
    # at perigee da/dt = -rho C_d S / m v^3 a^2 / mu, v^2 = mu / a (1 + e) / (1 - e)
    rate_m_s = density * craft.drag_area_per_mass_m2_kg * math.sqrt(MU_EARTH * a) * ((1 + e) / (1 - e)) ** 1.5
    margin_m = min(world.perturbations.scale_height_m or np.inf, max(perigee_m - R_EARTH - REENTRY_ALTITUDE_M, 0.0))
    return not rate_m_s * duration_s < 0.1 * margin_m
