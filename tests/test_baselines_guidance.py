"""Guidance: the desired paths have the ends, the shape and the dynamics that they claim."""

import numpy as np
import pytest

from baselines.guidance import Guidance, Guide, least_cost_path, least_fuel_path, straight_line
from baselines.timeline import nominal_start
from formation_env import FormationVectorEnv, load_scenario
from formation_env.dynamics.base import Array
from formation_env.schedule import leg_reference, legs

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
    leg, model = legs(scenario)[index], scenario.filter_model()
    path = least_fuel_path(scenario, leg)
    np.testing.assert_allclose(path[0], nominal_start(scenario, leg), atol=1e-9)
    np.testing.assert_allclose(path[-1], leg.phase.formation.state(scenario.orbit), atol=1e-9)
    jumps = path[1:] - path[:-1] @ model.Phi.T - model.delta
    thrust = jumps @ np.linalg.pinv(model.Gamma).T
    assert np.abs(thrust).max() < scenario.spacecraft.max_accel_m_s2
    not_thrust = jumps - thrust @ model.Gamma.T
    # the reference is a path of HCW, the model has J2: 1e-3 of gravity's gradient over a step
    assert np.abs(not_thrust[:, :3]).max() < 1e-3


@pytest.mark.parametrize("guide", ["automatic", "straight_line", "least_fuel", "least_cost"])
def test_tracking_agrees_with_the_truths_clock(guide: Guide) -> None:
    """Through transfer and hold: desired + error is the estimate, and desired + residual leads to the next desired.

    Desired states are looked up from single precision: 1e-7 of 2 km, and of n times that.
    """
    scenario = load_scenario("initialization")
    guidance, env = Guidance(scenario, guide), FormationVectorEnv(2, scenario)
    model, leg = scenario.filter_model(), legs(scenario)[0]
    observation, info = env.reset(seed=1)
    band = np.repeat([1e-2, 1e-5], 3)
    promised: Array | None = None
    for step in range(leg.end - 1):
        now = guidance.track(observation)
        assert (np.abs(now.desired + now.error - info["estimate"]) < band).all()
        assert (now.steps_left == leg.end - step).all()
        assert (now.in_hold == (step >= leg.arrival)).all()
        if promised is not None:
            assert (np.abs(now.desired - promised) < band).all()
        if step >= leg.arrival and guide != "least_cost":
            assert (np.abs(now.desired - leg_reference(scenario, leg, np.array(step))) < band).all()
        promised = now.desired @ model.Phi.T + model.delta + now.residual
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
