"""Policies by name, for commands that fly one."""

import importlib.metadata
from typing import TYPE_CHECKING, Final

from formation_env.cli_errors import DISTRIBUTION

if TYPE_CHECKING:
    from formation_env.evaluation.rollout import Policy
    from formation_env.task.scenario import Scenario

POLICIES: Final = "formation_env.policies"
"""Entry points of other packages: functions that make a policy from its name and a scenario."""


def make_policy(name: str | None, scenario: "Scenario") -> "Policy | None":
    """A policy by name, made by a package that offers policies; None without a name.

    Raises:
        ConfigError: no installed package offers policies, or none of that name.
    """
    from formation_env.settings import ConfigError

    if name is None:
        return None
    makers = list(importlib.metadata.entry_points(group=POLICIES))
    if not makers:
        raise ConfigError(f"--policy: no installed package offers policies; install {DISTRIBUTION} again")
    made: Policy = makers[0].load()(name, scenario)
    return made
