"""Leaders that do not stay in orbit are refused when the scenario is made."""

import dataclasses
import math

import numpy as np
import oracles
import pytest

from formation_env import Scenario, load_scenario
from formation_env.dynamics.coasting import REENTRY_ALTITUDE_M, check_leader_path, coast
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.world import World
from formation_env.navigation.sensor import Sensor
from formation_env.orbital.atmosphere import lifetime_s
from formation_env.orbital.orbit import Orbit
from formation_env.settings import ConfigError, build


def nonlinear(**changes: object) -> Scenario:
    return dataclasses.replace(load_scenario("keeping_nonlinear"), **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"perturbations": Perturbations(scale_height_m=60.0)},
            "leader: its motion cannot be integrated: too many steps",
        ),
        (
            {
                "orbit": Orbit(altitude_m=3700e3, eccentricity=0.3),
                "perturbations": Perturbations(scale_height_m=60e3),
            },
            "leader: its motion cannot be integrated: .* by perturbations.scale_height_m = 60000",
        ),
        (
            {
                "orbit": Orbit(altitude_m=16000e3, eccentricity=0.7),
                "perturbations": Perturbations(scale_height_m=60e3),
            },
            "leader: its motion cannot be integrated: ",
        ),
        (
            {
                "orbit": Orbit(altitude_m=150e3),
                "spacecraft": Spacecraft(mass_kg=4.0, area_m2=2.0, air_density_kg_m3=2e-9),
            },
            r"leader: re-enters at t = \d+\.?\d* s \(0\.\d+ orbits\)",
        ),
        (
            {"orbit": Orbit(altitude_m=120e3), "spacecraft": Spacecraft(mass_kg=4.0, air_density_kg_m3=1e-7)},
            "leader: re-enters at t = ",
        ),
    ],
    ids=["metres for kilometres", "dense air at perigee", "denser air", "light", "lower"],
)
def test_a_scenario_with_such_a_leader_is_refused(changes: dict[str, object], message: str) -> None:
    """Each of these never returned, failed when flown, or flew on below ground."""
    with pytest.raises(ValueError, match=message):
        nonlinear(**changes)


def test_reentry_is_when_the_energy_balance_says() -> None:
    """A circle at 150 km in air of a scale height of 20 km: lifetime_s to 80 km, within 10 % (it holds the speed)."""
    craft = Spacecraft(mass_kg=50.0, area_m2=1.0, air_density_kg_m3=5e-10)
    world = World(Orbit(altitude_m=150e3, j2=False), Perturbations(scale_height_m=20e3))
    life_s = lifetime_s(150e3, 5e-10, 20e3, craft.drag_area_per_mass_m2_kg)
    # h(t) = h(0) + H ln(1 - t / life)
    expected_s = life_s * (1 - math.exp((REENTRY_ALTITUDE_M - 150e3) / 20e3))
    with pytest.raises(ValueError, match="re-enters") as error:
        check_leader_path(world, craft, 10 * life_s)
    assert float(str(error.value).split("t = ")[1].split(" s")[0]) == pytest.approx(expected_s, rel=0.1)


@pytest.mark.parametrize(
    ("orbit", "perturbations"),
    [
        (Orbit(altitude_m=300e3), Perturbations(scale_height_m=40e3)),
        (Orbit(altitude_m=2e6, eccentricity=0.2), Perturbations()),
        (Orbit(altitude_m=100e3), Perturbations(drag=False)),
    ],
)
def test_what_is_not_integrated_stays_in_orbit(orbit: Orbit, perturbations: Perturbations) -> None:
    """The estimate that saves the integration is on the safe side: five orbits end above re-entry."""
    world, craft, duration_s = World(orbit, perturbations), Spacecraft(air_density_kg_m3=1e-12), 5 * orbit.period_s
    check_leader_path(world, craft, duration_s)
    a, e = orbit.semi_major_axis_m, orbit.eccentricity
    start = np.array([[a * (1 - e), 0, 0, 0, 0, math.sqrt(oracles.MU / a * (1 + e) / (1 - e))]])
    flown = coast(world, craft, start, np.linspace(0, duration_s, 500), who="leader")
    assert np.linalg.norm(flown[..., :3], axis=-1).min() - oracles.R_EARTH > REENTRY_ALTITUDE_M


@pytest.mark.parametrize(
    ("cls", "settings", "key"),
    [
        (Perturbations, {"epoch_jd": 1e300}, "epoch_jd"),
        (Sensor, {"sigma_pos_m": 1e155}, "sigma_pos_m"),
        (Spacecraft, {"max_accel_m_s2": 1e200}, "max_accel_m_s2"),
        (Spacecraft, {"mass_kg": 1e-300}, "mass_kg"),
        (Spacecraft, {"air_density_kg_m3": 2.0}, "air_density_kg_m3"),
    ],
)
def test_numbers_that_overflow_are_refused(cls: type, settings: dict[str, float], key: str) -> None:
    """They ended in OverflowError, in NaN, or never."""
    with pytest.raises(ConfigError, match=f"x.yaml: {key}: must be (less|greater) than or equal to "):
        build(cls, settings, "x.yaml")
