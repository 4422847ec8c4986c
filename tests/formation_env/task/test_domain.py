"""Where a scenario leaves its models: the curvature of the orbit, and the thrust that a transfer needs."""

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pytest
from env_helpers import MU, R_EARTH

from formation_env import Orbit, Scenario, Spacecraft, load_scenario, propagate, scenario_names
from formation_env.dynamics.perturbations import Perturbations
from formation_env.formations import AtLeader, Following, Formation
from formation_env.task.domain import DomainWarning, curvature_error_m, facts_of, valid_range_m, warnings_of
from formation_env.task.phases import Phase, Start

KEPLER = Orbit(j2=False)
RADIUS_M = R_EARTH + 600e3
PERIOD_S = 2 * np.pi * np.sqrt(RADIUS_M**3 / MU)


def held(formation: Formation, **changes: object) -> Scenario:
    """A scenario that starts in a formation and holds it."""
    phase = Phase(formation=formation, hold_orbits=1.0)
    return dataclasses.replace(Scenario(start=Start(formation=formation), phases=(phase,)), **changes)


def moved(distance_m: float, orbits: float, max_accel_m_s2: float) -> Scenario:
    """A transfer from the leader along the track."""
    phase = Phase(formation=Following(y0_m=distance_m), transfer_orbits=orbits, hold_orbits=1.0)
    return Scenario(phases=(phase,), dt_s=1.0, orbit=KEPLER, spacecraft=Spacecraft(max_accel_m_s2=max_accel_m_s2))


@pytest.mark.parametrize("arc_m", [2e3, 20e3, 220e3])
def test_curvature_error_is_what_the_nonlinear_truth_shows(arc_m: float) -> None:
    """A follower on the leader's circle stays where it is; the linear formation of the same arc has x = 0, it -s^2/2R.

    The next term is (s / R)^2 / 12 of it, 8e-5 at 220 km.
    """
    angle = arc_m / RADIUS_M
    speed = np.sqrt(MU / RADIUS_M)
    # relative position and velocity on the circle along the leader's axes; then as seen from the turning axes
    place = RADIUS_M * np.array([np.cos(angle) - 1, np.sin(angle), 0])
    velocity = speed * np.array([-np.sin(angle), np.cos(angle) - 1, 0])
    velocity -= np.cross([0, 0, speed / RADIUS_M], place)
    times_s = np.linspace(0, PERIOD_S, 7)
    true = propagate(
        np.concatenate([place, velocity]),
        times_s,
        dynamics="nonlinear",
        orbit=KEPLER,
        spacecraft=Spacecraft(air_density_kg_m3=0.0),
        perturbations=Perturbations(drag=False),
    )
    linear = Following(y0_m=arc_m).reference(times_s, KEPLER)
    np.testing.assert_allclose(linear[:, 0] - true[:, 0], curvature_error_m(arc_m, KEPLER), rtol=1e-4)


def test_the_valid_range_is_the_inverse() -> None:
    """At that range the error is the tolerance."""
    assert curvature_error_m(valid_range_m(50.0, KEPLER), KEPLER) == pytest.approx(50.0, rel=1e-12)


@pytest.mark.parametrize("name", scenario_names())
def test_shipped_scenarios_are_inside(name: str) -> None:
    """They warn of nothing (and pytest makes warnings errors); their transfers need less than they have."""
    scenario = load_scenario(name)
    facts = facts_of(scenario)
    assert warnings_of(scenario) == []
    assert facts["max_range_m"] < facts["valid_range_m"]
    assert facts["transfer_least_delta_v_m_s"] <= facts["transfer_authority_m_s"] <= facts["delta_v_authority_m_s"]
    assert facts["transfer_least_accel_m_s2"] <= scenario.spacecraft.max_accel_m_s2
    assert facts["duration_s"] == facts["num_steps"] * scenario.dt_s


@pytest.mark.parametrize(
    ("dynamics", "advice"), [("hcw", "dynamics: nonlinear does not"), ("nonlinear", "costs thrust")]
)
def test_far_formations_are_warned_of(dynamics: str, advice: str) -> None:
    """GRACE flies 220 km apart, where the orbit's curvature is 3.5 km."""
    scenario = held(Following(y0_m=-220e3), dynamics=dynamics, orbit=Orbit(altitude_m=480e3))
    (sentence,) = warnings_of(scenario)
    assert "At 220 km" in sentence
    assert "3.53e+03 m" in sentence
    assert advice in sentence
    with pytest.warns(DomainWarning, match="At 220 km"):
        load_scenario(scenario)
    tolerant = dataclasses.replace(scenario, tolerance_m=4000.0)
    assert warnings_of(tolerant) == []


def test_a_short_transfer_is_a_double_integrators() -> None:
    """From rest to rest over d in T: limit 4 d / T^2 at full thrust throughout, delta-v 2 d / T by two impulses.

    In T = 58 s the orbital terms (n T)^2 are 0.4 %; impulses are a sixtieth of T long.
    """
    scenario = moved(100.0, 0.01, 1.0)
    facts, duration_s = facts_of(scenario), scenario.steps(0.01) * scenario.dt_s
    assert facts["transfer_least_accel_m_s2"] == pytest.approx(4 * 100 / duration_s**2, rel=0.05)
    assert facts["transfer_least_delta_v_m_s"] == pytest.approx(2 * 100 / duration_s, rel=0.08)
    assert facts["transfer_authority_m_s"] == duration_s


def test_a_transfer_beyond_the_thruster_is_warned_of(tmp_path: Path) -> None:
    """2 km in half an orbit with 1e-6 m/s^2; from just above what it needs there is no warning."""
    needed = facts_of(moved(2000.0, 0.5, 0.1))["transfer_least_accel_m_s2"]
    (sentence,) = warnings_of(moved(2000.0, 0.5, 1e-6))
    assert f"phases.0 needs {needed:.3g} m/s^2" in sentence
    assert warnings_of(moved(2000.0, 0.5, 0.9 * needed)) != []
    assert warnings_of(moved(2000.0, 0.5, 1.01 * needed)) == []
    path = tmp_path / "weak.yaml"
    path.write_text(
        "spacecraft: {max_accel_m_s2: 1e-6}\n"
        "phases: [{formation: {kind: following}, transfer_orbits: 0.5, hold_orbits: 1}]\n"
    )
    with pytest.warns(DomainWarning, match="extend transfer_orbits or raise the thrust"):
        load_scenario(path)


def test_poor_tasks_are_named_but_load_without_a_warning() -> None:
    """One step, and a thruster that is on or off."""
    one_step = held(AtLeader(), dt_s=5800.0, dropout={"kind": "none"})
    (sentence,) = warnings_of(one_step)
    assert "single step of 5800 s" in sentence
    on_off = held(AtLeader(), spacecraft=Spacecraft(max_accel_m_s2=0.01, min_accel_m_s2=0.01))
    (sentence,) = warnings_of(on_off)
    assert "on/off" in sentence
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_scenario(one_step)
        load_scenario(on_off)
