"""From Stable-Baselines3's policies to actors that fly without it."""

from collections.abc import Mapping
from typing import Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from agents.algorithms.throttle_policy import ACTIVATIONS, SquashedPolicy
from agents.policy.actor import Actor, Functions, Layer
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario

State = Mapping[str, torch.Tensor]
"""Tensors of an SB3 policy by their names in it."""
ACTORS: Final = (("mlp_extractor.policy_net", "action_net"), ("actor.latent_pi", "actor.mu"))
"""Names of the actor's hidden layers and of its output layer: of PPO and A2C, and of SAC and TQC."""


def actor_of(model: BaseAlgorithm, throttle_power: float, scenario: Scenario) -> Actor:
    """Copy the actor of an SB3 model with SB3's "MlpPolicy" or the policies of `throttle_policy`.

    Args:
        model: PPO, A2C or SAC.
        throttle_power: p of the thrust sign(z) |z|^p for an output z.
        scenario: task that it was trained on.

    Raises:
        ConfigError: it is not a plain network with one of an actor's activations.
    """
    names = {kind: name for name, kind in ACTIVATIONS.items()}
    activation = names.get(getattr(model.policy, "activation_fn", nn.Module), "unknown")
    squash = "tanh" if model.policy.squash_output or isinstance(model.policy, SquashedPolicy) else "clip"
    magnification = model.policy.features_extractor_kwargs.get("magnification", 1.0)
    functions = Functions(activation, squash, throttle_power, magnification)
    return Actor(layers_of(model.policy.state_dict()), functions, scenario)


def layers_of(state: State) -> list[Layer]:
    """Select the actor's layers from a policy's tensors.

    Raises:
        ConfigError: the policy has none of `ACTORS`, or a features extractor with parameters.
    """
    if any("features_extractor" in name for name in state):
        raise ConfigError("policy: has a features extractor; only plain networks become actors")
    for hidden, last in ACTORS:
        if f"{last}.weight" in state:
            inner = sorted(int(name.split(".")[-2]) for name in state if name.startswith(hidden) and "weight" in name)
            return [_layer(state, name) for name in (*(f"{hidden}.{index}" for index in inner), last)]
    raise ConfigError("policy: only the MlpPolicy of PPO, A2C and SAC become actors")


def _layer(state: State, name: str) -> Layer:
    weight, bias = (state[f"{name}.{part}"].detach().numpy().astype(np.float32) for part in ("weight", "bias"))
    return weight, bias


def actor_modules(policy: nn.Module) -> list[nn.Linear]:
    """The linear layers of a policy's actor, first to last.

    Raises:
        ConfigError: the policy has none of `ACTORS`.
    """
    modules = dict(policy.named_modules())
    for hidden, last in ACTORS:
        if last in modules:
            parts = [*modules[hidden].children(), modules[last]]
            return [layer for layer in parts if isinstance(layer, nn.Linear)]
    raise ConfigError("policy: only the MlpPolicy of PPO, A2C and SAC become actors")
