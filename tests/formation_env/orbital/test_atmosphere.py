"""Exponential air and the decay that it causes."""

import math

import numpy as np
import oracles
import pytest
from numpy.typing import NDArray

from formation_env.orbital.atmosphere import decayed_altitude_m, exponential_density_kg_m3, lifetime_s
from formation_env.orbital.elements import Elements, to_cartesian
from formation_env.orbital.gauss_equations import propagate_elements

Array = NDArray[np.float64]

ALTITUDE_M, DENSITY_KG_M3, SCALE_HEIGHT_M, AREA_PER_MASS_M2_KG = 300e3, 2.4e-11, 53.6e3, 0.2


def test_density_of_a_textbook() -> None:
    """Vallado 2013, example 8-4: base 700 km, 3.614e-14 kg/m^3, scale height 88.667 km, at 747.2119 km; all digits."""
    density = exponential_density_kg_m3(747.2119e3, 3.614e-14, 700e3, 88.667e3)
    assert density == pytest.approx(2.1219854e-14, rel=1e-6)


def test_decay_is_that_of_a_flight_under_drag() -> None:
    """Gauss's equations with the same air, numerically, while the orbit sinks by nearly a scale height.

    The estimate holds speed and radius at their first values: an error of half the sunk part of the radius, below 0.4 %
    of the sunk height. The orbit stays circular but for 2 e a of some ten metres.
    """
    settings = (ALTITUDE_M, DENSITY_KG_M3, SCALE_HEIGHT_M, AREA_PER_MASS_M2_KG)
    times = np.linspace(0, 0.5 * lifetime_s(*settings), 6)

    def drag(_: float, position: Array, velocity: Array) -> Array:
        height = np.linalg.norm(position) - oracles.R_EARTH
        density = DENSITY_KG_M3 * math.exp((ALTITUDE_M - height) / SCALE_HEIGHT_M)
        return -0.5 * density * AREA_PER_MASS_M2_KG * np.linalg.norm(velocity) * velocity

    start = Elements(oracles.R_EARTH + ALTITUDE_M, 0.0, 0.9, 0.0, 0.0, 0.0)
    path = propagate_elements(start, times, drag)
    flown = path.semi_major_axis_m - oracles.R_EARTH
    sunk = ALTITUDE_M - flown[-1]
    assert 0.5 * SCALE_HEIGHT_M < sunk < SCALE_HEIGHT_M
    np.testing.assert_allclose(decayed_altitude_m(times, *settings), flown, rtol=0, atol=0.004 * sunk)
    np.testing.assert_allclose(np.linalg.norm(to_cartesian(path)[0], axis=1) - oracles.R_EARTH, flown, rtol=0, atol=50)


def test_first_sinking_is_that_of_the_energy_balance() -> None:
    """dE/dt = -1/2 rho v^3 C_d S / m and E = -mu / 2a: the leader of Ma 2009 sinks 1.5 m a day."""
    a = oracles.R_EARTH + 600e3
    speed = math.sqrt(oracles.MU / a)
    rate = -0.5 * 1.04e-13 * speed**3 / 312.5 * 2 * a**2 / oracles.MU
    lost = decayed_altitude_m(86400.0, 600e3, 1.04e-13, 71.8e3, 1 / 312.5) - 600e3
    assert lost == pytest.approx(rate * 86400, rel=1e-4)
    assert lost == pytest.approx(-1.5, abs=0.05)


def test_no_altitude_after_the_end() -> None:
    """The estimate ends where the logarithm does."""
    settings = (ALTITUDE_M, DENSITY_KG_M3, SCALE_HEIGHT_M, AREA_PER_MASS_M2_KG)
    with pytest.raises(ValueError, match="times_s: must be before the end of the orbit"):
        decayed_altitude_m([0.0, lifetime_s(*settings)], *settings)


def test_without_air_nothing_sinks() -> None:
    """A density of 0 was a division by zero."""
    assert lifetime_s(ALTITUDE_M, 0.0, SCALE_HEIGHT_M, AREA_PER_MASS_M2_KG) == math.inf
    path = decayed_altitude_m([0.0, 1e9], ALTITUDE_M, 0.0, SCALE_HEIGHT_M, AREA_PER_MASS_M2_KG)
    np.testing.assert_array_equal(path, [ALTITUDE_M, ALTITUDE_M])
