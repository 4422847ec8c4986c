"""Begin a training with an actor that can already fly, as one that imitated a classical policy."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.algorithms.sac import CriticFirstSAC
from agents.algorithms.to_actor import actor_of
from agents.hyperparameters import AgentSettings
from agents.policy.actor import Actor, read_actor
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario


def start_from(path: Path, model: BaseAlgorithm, agent: AgentSettings, scenario: Scenario) -> None:
    """Give a new model the actor of a safetensors file; its critics stay as they are.

    Args:
        path: of the file, see `agents.policy.actor`.
        model: of `make_model`; its weights are changed.
        agent: its hyperparameters.
        scenario: what is flown.

    Raises:
        ConfigError: the file is faulty, or its actor is not what the hyperparameters say; one line.
    """
    given, own = read_actor(path, scenario), actor_of(model, agent.throttle_power, scenario)
    for (name, ours), theirs in zip(_shape(own).items(), _shape(given).values(), strict=True):
        if ours != theirs:
            raise ConfigError(f"{path}: {name}: must be {ours}, by algorithm and hyperparameters, got {theirs}")
    with torch.no_grad():
        for target, source in zip(_actor_layers(model), given.layers, strict=True):
            target.weight.copy_(torch.from_numpy(source[0]))
            target.bias.copy_(torch.from_numpy(source[1]))
    if isinstance(model, CriticFirstSAC):
        model.keep_near()


def _shape(actor: Actor) -> dict[str, Any]:
    """All of an actor but its numbers."""
    return {**asdict(actor.functions), "hidden": [len(bias) for _, bias in actor.layers[:-1]]}


def _actor_layers(model: BaseAlgorithm) -> list[torch.nn.Linear]:
    """The layers of a model's actor, first to last."""
    policy = model.policy
    hidden, last = (
        (policy.actor.latent_pi, policy.actor.mu)
        if isinstance(model, CriticFirstSAC)
        else (policy.mlp_extractor.policy_net, policy.action_net)
    )
    return [layer for layer in (*hidden, last) if isinstance(layer, torch.nn.Linear)]
