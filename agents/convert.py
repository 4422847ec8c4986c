"""From Stable-Baselines3's networks to the actors that fly without it."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from zipfile import BadZipFile, ZipFile

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.actor import Actor, Functions, Layer
from agents.models import ACTIVATIONS
from agents.runs import MODEL, Run, load_run
from formation_env.scenario import Scenario
from formation_env.settings import ConfigError

State = Mapping[str, torch.Tensor]
"""Tensors of an SB3 policy by their names in it."""
ACTORS: Final = (("mlp_extractor.policy_net", "action_net"), ("actor.latent_pi", "actor.mu"))
"""Names of the actor's hidden layers and of its last one: of PPO and A2C, and of SAC and TQC."""
SQUASHES: Final = {"ppo": "clip", "sac": "tanh"}
WEIGHTS: Final = "policy.pth"
"""The member of SB3's file that holds tensors; the others are read by pickle."""


def actor_of(model: BaseAlgorithm, throttle_power: float, scenario: Scenario) -> Actor:
    """The actor of an SB3 model with SB3's "MlpPolicy".

    Args:
        model: PPO, A2C or SAC.
        throttle_power: p of the thrust sign(z) |z|^p that its actions z stand for.
        scenario: what it was trained on.

    Raises:
        ConfigError: it is no plain network of the activations that an actor knows.
    """
    names = {kind: name for name, kind in ACTIVATIONS.items()}
    activation = names.get(getattr(model.policy, "activation_fn", None), "unknown")
    squash = "tanh" if model.policy.squash_output else "clip"
    return Actor(layers_of(model.policy.state_dict()), Functions(activation, squash, throttle_power), scenario)


def actor_of_run(folder: Path, name: str = MODEL) -> tuple[Run, Actor]:
    """A training run and its policy. Of SB3's file only the tensors are read, so nothing is unpickled.

    Args:
        folder: the run's.
        name: `model.zip`, the best on the validation seeds, or `last.zip`.

    Raises:
        ConfigError: no run or no model is there, or the file is damaged; one line.
    """
    run, path = load_run(folder), folder / name
    try:
        with ZipFile(path) as archive:
            state = torch.load(io.BytesIO(archive.read(WEIGHTS)), map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file; the run has saved no model") from None
    except (BadZipFile, KeyError, EOFError, RuntimeError) as error:
        raise ConfigError(f"{path}: damaged, or no model: {' '.join(str(error).split())}") from None
    functions = Functions(run.agent.network.activation, SQUASHES[run.algorithm], run.agent.throttle_power)
    try:
        return run, Actor(layers_of(state), functions, run.scenario)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def layers_of(state: State) -> list[Layer]:
    """The actor's layers out of a policy's tensors.

    Raises:
        ConfigError: the policy has none of `ACTORS`, or something before it.
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
