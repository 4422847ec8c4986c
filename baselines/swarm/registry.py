"""Policies for several followers by name."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from baselines.swarm.architectures import ARCHITECTURES, ArchitectureSettings
from baselines.swarm.avoidance import AVOIDANCE, AvoidanceSettings
from baselines.swarm.policy import SwarmPolicy
from baselines.swarm.scp import Scp, ScpSettings
from formation_env.settings import ConfigError, build, nearest
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

NO_AVOIDANCE = "none"


def make_swarm_policy(
    name: str,
    scenario: str | Path | Scenario,
    avoidance: str = NO_AVOIDANCE,
    settings: Mapping[str, Any] | ArchitectureSettings | ScpSettings | None = None,
    avoidance_settings: Mapping[str, Any] | AvoidanceSettings | None = None,
) -> SwarmPolicy:
    """A policy for a scenario of several followers.

    Args:
        name: one of `ARCHITECTURES`, or `scp`.
        scenario: a registered id, a scenario's name, the path of a YAML file, or a Scenario.
        avoidance: one of `AVOIDANCE`, or `none`.
        settings: of the architecture: keys of `ArchitectureSettings`, or of `ScpSettings`.
        avoidance_settings: keys of `AvoidanceSettings`.

    Raises:
        ConfigError: no such policy, layer or scenario, or wrong settings.
    """
    if name not in (Scp.name, *ARCHITECTURES):
        raise ConfigError(f"no architecture named {name!r}; {nearest(name, (Scp.name, *ARCHITECTURES))}")
    if avoidance not in (NO_AVOIDANCE, *AVOIDANCE):
        raise ConfigError(f"no avoidance named {avoidance!r}; {nearest(avoidance, (NO_AVOIDANCE, *AVOIDANCE))}")
    if name == Scp.name:
        if avoidance != NO_AVOIDANCE:
            raise ConfigError(
                f"avoidance: scp keeps apart by its plan, so it takes {NO_AVOIDANCE!r}, got {avoidance!r}"
            )
        of_plan = settings if isinstance(settings, ScpSettings) else build(ScpSettings, settings or {}, name)
        return Scp(load_scenario(scenario), of_plan)
    own = settings if isinstance(settings, ArchitectureSettings) else build(ArchitectureSettings, settings or {}, name)
    policy = ARCHITECTURES[name](load_scenario(scenario), own)
    if avoidance == NO_AVOIDANCE:
        return policy
    layer = avoidance_settings
    if not isinstance(layer, AvoidanceSettings):
        layer = build(AvoidanceSettings, layer or {}, avoidance)
    return AVOIDANCE[avoidance](policy, layer)
