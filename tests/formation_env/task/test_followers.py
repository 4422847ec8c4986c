"""Scenarios of several followers: what is refused, and each follower's own scenario."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from formation_env import ConfigError, Scenario, load_scenario, swarm_names
from formation_env.settings import build
from formation_env.task.followers import FollowerSettings
from formation_env.task.members import members
from formation_env.task.observation import observation_layout
from formation_env.task.schedule import build_schedule, columns

CIRCLE = {"kind": "space_circle", "x0_m": 250, "vx0_m_s": 0}
SWAP: dict[str, Any] = {
    "followers": 8,
    "spacecraft": {"max_accel_m_s2": 0.005},
    "start": {"formation": CIRCLE},
    "phases": [{"formation": CIRCLE, "transfer_orbits": 0.5, "hold_orbits": 0.5}],
    "safety": {"min_distance_m": 200},
}
FOLLOWING = {"kind": "following", "y0_m": 300}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"followers": 13}, "followers: must be less than or equal to 12, got 13"),
        ({"followers": 0}, "followers: must be greater than or equal to 1, got 0"),
        ({"followers": 2.5}, "followers: must be a valid integer, got 2.5"),
        ({"start": {"formation": FOLLOWING}}, "start.formation: formation following: has one place for 8 followers"),
        (
            {"followers": 2, "start": {"formation": {"kind": "list", "formations": [FOLLOWING, FOLLOWING]}}},
            "start.formation: slots 0 and 1 are one place, or meet on the way",
        ),
        (
            {"safety": {"min_distance_m": 400}},
            "start.formation: slots 0 and 1 come within 382.683 m, nearer than safety.min_distance_m = 400 m",
        ),
        (
            {"start": {"formation": {"kind": "train", "y0_m": 100, "spacing_m": 300}}},
            "start.formation: slot 0 and the leader come within 100 m, nearer than safety.min_distance_m = 200 m",
        ),
        ({"neighbours": 8}, "neighbours: each of 8 followers has 7, got 8"),
        ({"follower_settings": [{}]}, "follower_settings: must have 8, one for each follower, or none, got 1"),
        (
            {"follower_settings": [{}, {"sensor": {"measures": "position"}}] + [{}] * 6},
            "follower_settings.1: must be of the group's kind, position_and_velocity, got position",
        ),
        ({"slots": "drawn"}, "slots: must be 'fixed' or 'random', got the string 'drawn'"),
        (
            {"safety": {"min_distance_m": 100, "collision_distance_m": 200}},
            "safety.collision_distance_m: must not be above min_distance_m = 100 m, got 200 m",
        ),
        (
            {"domain_randomization": {"altitude_m": [400e3, 500e3]}},
            "domain_randomization: is for a single follower, got followers = 8",
        ),
        (
            {"inter_satellite_link": {"dropout": {"kind": "gilbert_elliott", "mean_outage_s": 1}}},
            "dropout.mean_outage_s: a mean of 1 s is shorter than the step",
        ),
        (
            {"follower_settings": [{"spacecraft": {"air_density_kg_m3": 1e-12}}] + [{}] * 7},
            "follower 0: leader_spacecraft.air_density_kg_m3: must be the follower's",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_name(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        build(Scenario, SWAP | changed, "x.yaml")
    assert message in str(error.value)
    assert str(error.value).startswith("x.yaml: ")


@pytest.mark.parametrize("name", swarm_names())
def test_shipped_swarms_load_and_have_a_scenario_for_each_slot(name: str) -> None:
    """Follower i starts in slot i and flies to any slot; the slots together are the formation's."""
    scenario = load_scenario(name)
    alone = members(scenario)
    assert [len(slots) for slots in alone] == [scenario.followers] * scenario.followers
    for follower, slots in enumerate(alone):
        starts = {each.start for each in slots}
        assert len(starts) == 1
        (start,) = starts
        assert start.formation == scenario.start.formation.slots(scenario.followers, scenario.orbit)[follower]
        for slot, each in enumerate(slots):
            target = scenario.phases[0].formation.slots(scenario.followers, scenario.orbit)[slot]
            assert each.phases[0].formation == target
            assert replace(observation_layout(each), num_neighbours=scenario.num_neighbours) == observation_layout(
                scenario
            )


def test_all_slots_of_a_circle_are_flown() -> None:
    """The references of the slots at the arrival are the corners of the polygon, each once."""
    (slots, *_) = members(build(Scenario, SWAP, "x"))
    arrivals = np.array([columns(build_schedule(each), "reference")[-1, :3] for each in slots])
    np.testing.assert_allclose(np.linalg.norm(arrivals, axis=1), 500, rtol=1e-6)
    assert len(np.unique(arrivals.round(3), axis=0)) == 8


def test_followers_have_what_is_their_own() -> None:
    """A follower with a spacecraft of its own keeps the group's leader."""
    scenario = build(Scenario, SWAP, "x")
    heavy = replace(scenario.spacecraft, mass_kg=100.0)
    mixed = replace(scenario, follower_settings=(FollowerSettings(spacecraft=heavy), *[FollowerSettings()] * 7))
    first, second = members(mixed)[0][0], members(mixed)[1][1]
    assert (first.spacecraft, first.leader) == (heavy, scenario.spacecraft)
    assert (second.spacecraft, second.leader) == (scenario.spacecraft, scenario.spacecraft)


def test_a_single_follower_is_its_own_member() -> None:
    scenario = load_scenario("keeping")
    assert members(scenario) == ((scenario,),)
