"""The followers of a scenario, each as a scenario of its own."""

from dataclasses import replace
from functools import lru_cache

from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario


@lru_cache(maxsize=8)
def members(scenario: Scenario) -> tuple[tuple[Scenario, ...], ...]:
    """The scenario of each follower in each slot, as `members[follower][slot]`; a scenario of one follower is its own.

    All have the group's scale of the observation.
    """
    if scenario.followers == 1:
        return ((scenario,),)
    scaled = replace(scenario, observation_length_m=observation_layout(scenario).length_m)
    every = range(scenario.followers)
    return tuple(tuple(scaled.follower_alone(follower, slot) for slot in every) for follower in every)
