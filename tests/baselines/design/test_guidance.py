"""Guidance: the desired paths have the ends, the shape and the dynamics that they claim."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from env_helpers import noise_free

from baselines import make_policy
from baselines.design.guidance import (
    PATHS,
    Guidance,
    GuidanceName,
    hohmann_path,
    least_cost_path,
    least_fuel_path,
    straight_line,
    two_impulse_path,
)
from baselines.design.phase_tables import nominal_start
from formation_env import ConfigError, FormationVectorEnv, Scenario, load_scenario, propagate
from formation_env.evaluation.rollout import evaluate
from formation_env.formations import AnyFormation, Following, Parallel, ProjectedCircle, SpaceCircle, XYEllipse
from formation_env.numerics.arrays import Array
from formation_env.task.phases import Phase
from formation_env.task.schedule import leg_reference, legs

TRANSFERS = [(name, index) for name, count in (("initialization", 1), ("mission", 2)) for index in range(count)]


@pytest.mark.parametrize(("name", "index"), TRANSFERS)
def test_straight_line_hits_its_ends(name: str, index: int) -> None:
    """The line leads from where the phase before ends to the target formation (Ma 2009, section 3.2.2)."""
    scenario = load_scenario(name)
    leg = legs(scenario)[index]
    before = scenario.start.formation.state(scenario.orbit)
    if index > 0:
        elapsed_s = scenario.dt_s * (leg.start - legs(scenario)[index - 1].arrival)
        before = scenario.phases[index - 1].formation.reference(elapsed_s, scenario.orbit)
    goal = leg.phase.formation.state(scenario.orbit)
    line = straight_line(scenario, leg)
    np.testing.assert_allclose(line[0, :3], before[:3], atol=1e-9)
    np.testing.assert_allclose(line[-1], goal, atol=1e-9)
    np.testing.assert_allclose(np.diff(line[:, :3], axis=0), scenario.dt_s * line[:-1, 3:], atol=1e-9)
    assert np.ptp(line[:-1, 3:], axis=0).max() == 0


@pytest.mark.parametrize(("name", "index"), TRANSFERS)
def test_least_fuel_path_arrives(name: str, index: int) -> None:
    """From the nominal start to the target, by accelerations within the limit alone."""
    scenario = load_scenario(name)
    leg, model = legs(scenario)[index], scenario.filter_dynamics()
    path = least_fuel_path(scenario, leg)
    np.testing.assert_allclose(path[0], nominal_start(scenario, leg), atol=1e-9)
    np.testing.assert_allclose(path[-1], leg.phase.formation.state(scenario.orbit), atol=1e-9)
    jumps = path[1:] - path[:-1] @ model.Phi.T - model.delta
    thrust = jumps @ np.linalg.pinv(model.Gamma).T
    assert np.abs(thrust).max() < scenario.spacecraft.max_accel_m_s2
    not_thrust = jumps - thrust @ model.Gamma.T
    # the reference is a path of HCW, the model has J2: 1e-3 of gravity's gradient over a step
    assert np.abs(not_thrust[:, :3]).max() < 1e-3


@pytest.mark.parametrize("guide", PATHS)
def test_tracking_agrees_with_the_truths_clock(guide: GuidanceName) -> None:
    """Through transfer and hold: desired + error is the estimate, and desired + residual leads to the next desired.

    Desired states are looked up from single precision: 1e-7 of 2 km, and of n times that.
    """
    scenario = load_scenario("initialization")
    guidance, env = Guidance(scenario, guide), FormationVectorEnv(2, scenario)
    model, leg = scenario.filter_dynamics(), legs(scenario)[0]
    observation, info = env.reset(seed=1)
    band = np.repeat([1e-2, 1e-5], 3)
    promised: Array | None = None
    for step in range(leg.end - 1):
        now = guidance.track(observation)
        assert (np.abs(guidance.desired[now.at] + now.error - info["estimate"]) < band).all()
        assert (now.at[1] == leg.end - step).all()
        assert (now.at[0] == leg.index).all()
        if promised is not None:
            assert (np.abs(guidance.desired[now.at] - promised) < band).all()
        if step >= leg.arrival and guide != "least_cost":
            assert (np.abs(guidance.desired[now.at] - leg_reference(scenario, leg, np.array(step))) < band).all()
        promised = guidance.desired[now.at] @ model.Phi.T + model.delta + guidance.residuals[now.at]
        observation, _, _, _, info = env.step(np.zeros((2, 3), np.float32))


def test_phases_have_paths_of_their_own() -> None:
    """The mission's second transfer starts on the ellipse, not at the leader."""
    scenario = load_scenario("mission")
    second = legs(scenario)[1]
    assert np.linalg.norm(nominal_start(scenario, second)[:3]) == pytest.approx(2000, rel=1e-3)


def test_least_cost_path_settles_on_the_reference() -> None:
    """It begins at the nominal start and is there in the middle of the hold at the latest, to a metre."""
    scenario = load_scenario("initialization")
    leg = legs(scenario)[0]
    path = least_cost_path(scenario, leg)
    np.testing.assert_allclose(path[0], nominal_start(scenario, leg), atol=1e-9)
    middle = (leg.arrival + leg.end) // 2
    assert np.abs(path[middle, :3] - leg_reference(scenario, leg, np.array(middle))[:3]).max() < 1


def from_following(y0_m: float, formation: AnyFormation, transfer_orbits: float = 0.5) -> Scenario:
    """From y0_m ahead of the leader to a formation without noise, by HCW, in steps of 1/600 period."""
    scenario = noise_free("initialization")
    return dataclasses.replace(
        scenario,
        dynamics="hcw",
        dt_s=scenario.orbit.period_s / 600,
        start=dataclasses.replace(scenario.start, formation=Following(y0_m=y0_m)),
        phases=(Phase(formation=formation, transfer_orbits=transfer_orbits, hold_orbits=0.5),),
    )


@pytest.mark.parametrize(("name", "index"), [*TRANSFERS, ("reconfiguration", 0)])
def test_two_impulse_path_coasts_to_its_goal(name: str, index: int) -> None:
    """Between its ends the path is the force-free motion, and it begins and arrives where the plan says.

    The path and the propagation make the same large steps of an exact model: rounding of a few km.
    """
    scenario = load_scenario(name)
    leg = legs(scenario)[index]
    path = two_impulse_path(scenario, leg)
    times_s = scenario.dt_s * np.arange(len(path))
    coasting = propagate(path[0], times_s, orbit=scenario.orbit, spacecraft=scenario.spacecraft)
    np.testing.assert_allclose(path[:-1], coasting[:-1], atol=1e-7)
    np.testing.assert_allclose(path[0, :3], nominal_start(scenario, leg)[:3], atol=1e-9)
    np.testing.assert_allclose(coasting[-1, :3], path[-1, :3], atol=1e-6)
    np.testing.assert_allclose(path[-1], leg.phase.formation.state(scenario.orbit), atol=1e-9)


def test_hohmann_path_is_half_an_ellipse() -> None:
    """To x0 above the leader's orbit: x = x0 / 2 (1 - cos nt), y = y0 + x0 (sin nt - 3/4 nt), by eq. (3.2-3.3).

    Half a period takes the follower 3 pi / 4 x0 back, so that is how far ahead it starts.
    """
    x0 = 1000.0
    scenario = from_following(0.75 * np.pi * x0, Parallel(x0_m=x0))
    path = hohmann_path(scenario, legs(scenario)[0])
    angle = np.linspace(0, np.pi, 301)
    np.testing.assert_allclose(path[:, 0], x0 / 2 * (1 - np.cos(angle)), atol=1e-6)
    np.testing.assert_allclose(path[:, 1], x0 * (0.75 * np.pi + np.sin(angle) - 0.75 * angle), atol=1e-6)
    np.testing.assert_allclose(path[:, [2, 5]], 0, atol=1e-12)


def test_hohmann_path_waits_on_the_reference() -> None:
    """With 0.9 periods it coasts for half of one, and is where the target is at that time; then it is the target."""
    scenario = from_following(500.0, XYEllipse(x0_m=300.0), 0.9)
    leg = legs(scenario)[0]
    path = hohmann_path(scenario, leg)
    assert len(path) == 541
    waiting = propagate(XYEllipse(x0_m=300.0).state(scenario.orbit), scenario.dt_s * np.arange(-240, 1), dynamics="hcw")
    np.testing.assert_allclose(path[300:], waiting, atol=1e-8)
    coasting = propagate(path[0], scenario.dt_s * np.arange(301), dynamics="hcw")
    np.testing.assert_allclose(path[:301, :3], coasting[:, :3], atol=1e-6)


REFUSED: dict[str, tuple[GuidanceName, AnyFormation, float, str]] = {
    "too short": ("hohmann", Parallel(), 0.4, "hohmann: phases.0.transfer_orbits: must be at least 0.5"),
    "another plane": ("hohmann", ProjectedCircle(), 0.5, "hohmann: phases.0.formation: must be in the plane of"),
    "no leverage": ("two_impulse", SpaceCircle(), 0.5, "phases.0.transfer_orbits: time_s: no two impulses"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_transfers_that_no_impulses_fly_are_refused(case: str) -> None:
    """When the policy is made, in one line that names the phase."""
    guide, formation, periods, message = REFUSED[case]
    scenario = from_following(500.0, formation, periods)
    with pytest.raises(ConfigError, match=f"^guidance: {message}") as error:
        make_policy("smc", scenario, {"guidance": guide})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("behind", [0.0, 0.75 * np.pi])
def test_straight_line_of_half_a_period_is_near_hohmanns_ellipse(behind: float) -> None:
    """Ma 2009, section 3.2.2: "the absolute orbit is almost the same". How near, for a parallel formation x0 above.

    In ECI the line's radius is r + x0 angle / pi to first order in x0 / r, the ellipse's r + x0 / 2 (1 - cos angle):
    they part by 0.1053 x0 where sin(angle) = 2 / pi, whichever the along-track distance. The next order is x0 / r.
    """
    x0 = 1000.0
    scenario = from_following(behind * x0, Parallel(x0_m=x0))
    line = straight_line(scenario, legs(scenario)[0])
    r = scenario.orbit.radius_m
    angle = np.linspace(0, np.pi, 301) + np.arctan2(line[:, 1], r + line[:, 0])
    radius = np.hypot(r + line[:, 0], line[:, 1])
    axis, eccentricity = r + x0 / 2, x0 / (2 * r + x0)
    ellipse = axis * (1 - eccentricity**2) / (1 + eccentricity * np.cos(angle - angle[0]))
    apart = (radius - ellipse) / x0
    widest = np.arcsin(2 / np.pi)
    assert apart.max() == pytest.approx(widest / np.pi - (1 - np.cos(widest)) / 2, abs=10 * x0 / r)
    assert apart.min() == pytest.approx(-apart.max(), abs=10 * x0 / r)


SLOW = {"velocity_s2": [1e4, 1e4, 1e4], "control_s2": [1e2, 1e2, 1e2]}
CONTROLLERS: dict[str, dict[str, Any]] = {
    "lqr": {"design": "weights"},
    "lqr_quasi_static": {"hold": SLOW, "transfer": SLOW},
    "lqr_quasi_static integrated": {"hold": SLOW, "transfer": SLOW, "feedforward": "integrated"},
    "smc": {},
    "smc relay": {"reaching": {"kind": "relay", "u0_m_s2": 0.004}, "boundary_m": 200.0},
}


@pytest.mark.parametrize("guide", PATHS)
@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_flies_every_guide(name: str, guide: str) -> None:
    """2 km in half a period without noise: the hold is within 10 % of the way, for at most thrice a line's delta-v.

    At constant speed v a straight line along-track costs the two velocity jumps and 2 n v (Coriolis) all the time.
    """
    scenario = noise_free("initialization")
    gains = {**CONTROLLERS[name], "guidance": guide}
    flown = evaluate(make_policy(name.split()[0], scenario, gains), scenario, [0]).iloc[0]
    speed = 2000 / (0.5 * scenario.orbit.period_s)
    line = 2 * speed + 2 * scenario.orbit.mean_motion_rad_s * 2000
    assert flown["position_error_mean_m"] < 200
    assert flown["delta_v_m_s"] < 3 * line
