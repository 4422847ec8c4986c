"""Search spaces applied to settings; each policy class states its own, and default.yaml has its section."""

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from baselines.controllers.registry import POLICIES, read_settings
from baselines.controllers.search_space import Parameter
from formation_env.settings import load_yaml
from formation_env.task.loading import config_folder
from formation_env.task.scenario import Scenario

SEARCH_SPACES: Final[dict[str, tuple[Parameter, ...]]] = {
    name: policy.search_space
    for name, policy in sorted(POLICIES.items(), key=lambda each: each[1].slow)
    if policy.search_space
}
"""Policy -> its search space; slow policies come last."""


def search_space(policy: str, scenario: Scenario) -> tuple[Parameter, ...]:
    """The parameters of a policy's search space that affect a scenario."""
    transfers = any(scenario.steps(phase.transfer_orbits) for phase in scenario.phases)
    return tuple(parameter for parameter in SEARCH_SPACES[policy] if transfers or not parameter.transfer)


def default_settings(policy: str) -> dict[str, Any]:
    """The policy's section of default.yaml, where a search starts; it has every parameter's keys."""
    path = config_folder("baselines") / "default.yaml"
    read_settings(policy, path)  # refuses what is wrong in it
    section: dict[str, Any] = load_yaml(path)[policy]
    return section


def values_in_use(policy: str, path: Path, parameters: Sequence[Parameter]) -> dict[str, float] | None:
    """Values of the parameters in a settings file, clipped to their limits; None if the file does not give them all.

    Raises:
        ConfigError: the file is faulty.
    """
    if not path.is_file():
        return None
    read_settings(policy, path)
    try:
        values = current_values(load_yaml(path).get(policy, {}), parameters)
    except (KeyError, IndexError, TypeError):
        return None
    return {each.name: min(max(values[each.name], each.low), each.high) for each in parameters}


def apply(settings: dict[str, Any], parameters: Sequence[Parameter], values: Mapping[str, float]) -> dict[str, Any]:
    """Settings with the parameters at values, by the parameters' names, rounded to three digits."""
    changed = copy.deepcopy(settings)
    for parameter in parameters:
        for key in parameter.keys:
            parent, last = _parent(changed, key)
            parent[last] = float(f"{values[parameter.name]:.3g}")
    return changed


def current_values(settings: dict[str, Any], parameters: Sequence[Parameter]) -> dict[str, float]:
    """Values of the parameters in settings, by name."""
    places = {parameter.name: _parent(settings, parameter.name) for parameter in parameters}
    return {name: float(parent[last]) for name, (parent, last) in places.items()}


def _parent(settings: Any, key: str) -> tuple[Any, Any]:
    """The mapping or list that holds a setting, and the setting's key or index in it."""
    *parents, last = [int(part) if part.isdigit() else part for part in key.split(".")]
    for part in parents:
        settings = settings[part]
    return settings, last
