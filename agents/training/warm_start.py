"""Start a training from an actor that already flies, for example one that imitated a classical policy."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.algorithms.to_actor import actor_modules, actor_of
from agents.hyperparameters import CommonSettings
from agents.policy.actor import Actor, read_actor
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario


def start_from(path: Path, model: BaseAlgorithm, settings: CommonSettings, scenario: Scenario) -> None:
    """Copy the actor of a safetensors file into a new model; its critics are unchanged.

    Args:
        path: of the file, see `agents.policy.actor`.
        model: of `make_model`; its weights are changed.
        settings: its hyperparameters.
        scenario: task that is flown.

    Raises:
        ConfigError: the file is faulty, or its actor does not have the shape that the hyperparameters give; one line.
    """
    given, own = read_actor(path, scenario), actor_of(model, settings.throttle_power, scenario)
    for (name, expected), value in zip(_shape(own).items(), _shape(given).values(), strict=True):
        if expected != value:
            raise ConfigError(f"{path}: {name}: must be {expected}, by algorithm and hyperparameters, got {value}")
    with torch.no_grad():
        for target, source in zip(actor_modules(model.policy), given.layers, strict=True):
            target.weight.copy_(torch.from_numpy(source[0]))
            target.bias.copy_(torch.from_numpy(source[1]))
    settings.on_warm_start(model)


def _shape(actor: Actor) -> dict[str, Any]:
    """Everything about an actor except its weights."""
    return {**asdict(actor.functions), "hidden": [len(bias) for _, bias in actor.layers[:-1]]}
