"""Variations of the shipped scenarios, for the tests of the fuel optimum."""

import dataclasses

from formation_env import load_scenario
from formation_env.task.scenario import Scenario


def vary(name: str, **changes: float | str) -> Scenario:
    """A shipped scenario with other settings, of the scenario or of its spacecraft or reward."""
    scenario = load_scenario(name)
    for key, value in changes.items():
        owner = next(part for part in (scenario, scenario.spacecraft, scenario.reward) if hasattr(part, key))
        changed = dataclasses.replace(owner, **{key: value})
        if owner is scenario:
            scenario = changed
        else:
            field = "spacecraft" if owner is scenario.spacecraft else "reward"
            scenario = dataclasses.replace(scenario, **{field: changed})
    return scenario


def with_phase(scenario: Scenario, **changes: float) -> Scenario:
    """The scenario with other times of its first and only phase."""
    return dataclasses.replace(scenario, phases=(dataclasses.replace(scenario.phases[0], **changes),))
