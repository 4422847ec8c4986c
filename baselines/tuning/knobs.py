"""Search spaces applied to settings; each policy class states its own, see `baselines.controllers.search_space`."""

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from baselines.controllers.registry import POLICIES, read_settings
from baselines.controllers.search_space import Parameter
from formation_env.settings import load_yaml
from formation_env.task.loading import config_folder
from formation_env.task.scenario import Scenario

Knob = Parameter

KNOBS: Final[dict[str, tuple[Knob, ...]]] = {
    name: policy.search_space
    for name, policy in sorted(POLICIES.items(), key=lambda each: each[1].slow)
    if policy.search_space
}
"""Policy -> its search space; slow ones come last."""


def knobs_for(policy: str, scenario: Scenario) -> tuple[Knob, ...]:
    """The knobs of a policy that matter to a scenario."""
    transfers = any(scenario.steps(phase.transfer_orbits) for phase in scenario.phases)
    return tuple(knob for knob in KNOBS[policy] if transfers or not knob.transfer)


def first_gains(policy: str) -> dict[str, Any]:
    """What a search begins with: the policy's section of default.yaml, which has every knob."""
    path = config_folder("baselines") / "default.yaml"
    read_settings(policy, path)  # refuses what is wrong in it
    section: dict[str, Any] = load_yaml(path)[policy]
    return section


def present_gains(policy: str, path: Path, knobs: Sequence[Knob]) -> dict[str, float] | None:
    """Where the knobs stand in a gain file, cut to their limits; None if it does not say.

    Raises:
        ConfigError: the file is faulty.
    """
    if not path.is_file():
        return None
    read_settings(policy, path)
    try:
        values = read(load_yaml(path).get(policy, {}), knobs)
    except (KeyError, IndexError, TypeError):
        return None
    return {knob.name: min(max(values[knob.name], knob.low), knob.high) for knob in knobs}


def turn(gains: dict[str, Any], knobs: Sequence[Knob], values: Mapping[str, float]) -> dict[str, Any]:
    """Gains with the knobs at values, by the knobs' names, to three digits."""
    turned = copy.deepcopy(gains)
    for knob in knobs:
        for key in knob.keys:
            target, last = _place(turned, key)
            target[last] = float(f"{values[knob.name]:.3g}")
    return turned


def read(gains: dict[str, Any], knobs: Sequence[Knob]) -> dict[str, float]:
    """Where the knobs stand, by name."""
    places = {knob.name: _place(gains, knob.name) for knob in knobs}
    return {name: float(target[last]) for name, (target, last) in places.items()}


def _place(gains: Any, key: str) -> tuple[Any, str | int]:
    """The mapping or list that holds a gain, and the gain's key or index in it."""
    *parents, last = [int(part) if part.isdigit() else part for part in key.split(".")]
    for part in parents:
        gains = gains[part]
    return gains, last
