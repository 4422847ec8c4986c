"""The whole state of a training in one file, so that after a kill it goes on as if nothing had been.

The file holds tensors, numbers and texts, and is read with torch's `weights_only`: nothing in it is executed. What it
leaves out is the running means of episodes that only TensorBoard shows.
"""

import json
import pickle
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.vec_env import VecNormalize

from formation_env.files import replacing
from formation_env.settings import ConfigError

State = dict[str, Any]

COUNTERS: Final = ("num_timesteps", "_n_updates", "_episode_num")
REMEMBERED: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of a replay buffer, (transitions of a row, rows, ...)."""


def save_checkpoint(path: Path, model: BaseAlgorithm, notes: State) -> None:
    """Write the state of a model between two rollouts; interrupted, it leaves the old file.

    Args:
        path: of the file.
        model: with its environment.
        notes: whatever else is to be found again; plain values.

    Raises:
        OSError: the folder cannot be written.
    """
    vec_env = model.get_env()
    assert vec_env is not None, "a model in training has an environment"
    state: State = {
        "notes": notes,
        "parameters": model.get_parameters(),
        "counters": {name: getattr(model, name) for name in COUNTERS},
        "rows": torch.from_numpy(vec_env.unwrapped.memory()),
        "observations": torch.from_numpy(model._last_obs),
        "starts": torch.from_numpy(model._last_episode_starts),
        "random": _random_state(model),
    }
    if isinstance(vec_env, VecNormalize):
        deviation = vec_env.ret_rms
        state["returns"] = [float(deviation.mean), float(deviation.var), float(deviation.count)]
        state["discounted"] = torch.from_numpy(vec_env.returns)
    if isinstance(model, SAC):
        state["log_ent_coef"] = model.log_ent_coef.detach()
        state["replay"] = _replay_state(model.replay_buffer)
    with replacing(path) as temporary:
        torch.save(state, temporary)


def load_checkpoint(path: Path) -> State:
    """A state written by `save_checkpoint`.

    Raises:
        ConfigError: the file cannot be read, or is damaged; one line.
    """
    try:
        state: State = torch.load(path, weights_only=True)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise ConfigError(f"{path}: damaged, or no checkpoint: {' '.join(str(error).split())[:80]}") from None
    return state


def restore(model: BaseAlgorithm, state: State) -> None:
    """Put a new model of the same settings, and its environment, where a checkpoint left them.

    Random states are not among it: what comes before the next rollout would use them up; see `restore_random`.
    """
    vec_env = model.get_env()
    assert vec_env is not None, "a model in training has an environment"
    model.set_parameters(state["parameters"])
    for name, value in state["counters"].items():
        setattr(model, name, value)
    observations = state["observations"].numpy()
    vec_env.unwrapped.recall(state["rows"].numpy(), observations)
    model._last_obs = model._last_original_obs = observations
    model._last_episode_starts = state["starts"].numpy()
    if isinstance(vec_env, VecNormalize):
        deviation = vec_env.ret_rms
        deviation.mean, deviation.var, deviation.count = state["returns"]
        vec_env.returns = state["discounted"].numpy()
    if isinstance(model, SAC):
        model.log_ent_coef.data.copy_(state["log_ent_coef"])
        _refill(model.replay_buffer, state["replay"])


def _replay_state(buffer: ReplayBuffer) -> State:
    filled = {name: torch.from_numpy(getattr(buffer, name)[: buffer.size()]) for name in REMEMBERED}
    return filled | {"pos": buffer.pos, "full": buffer.full}


def _refill(buffer: ReplayBuffer, state: State) -> None:
    buffer.pos, buffer.full = state["pos"], state["full"]
    for name in REMEMBERED:
        getattr(buffer, name)[: buffer.size()] = state[name].numpy()


def _random_state(model: BaseAlgorithm) -> State:
    """Of torch and of the two streams of NumPy that SB3 draws from; those of the environment are in its rows."""
    _, keys, *rest = np.random.get_state()  # noqa: NPY002 (SB3 shuffles and samples with the global stream)
    return {
        "torch": torch.get_rng_state(),
        "numpy": [torch.from_numpy(keys), *rest],
        "actions": json.dumps(model.action_space.np_random.bit_generator.state),
    }


def restore_random(model: BaseAlgorithm, state: State) -> None:
    """Set all random streams to where a checkpoint left them."""
    random = state["random"]
    torch.set_rng_state(random["torch"])
    keys, *rest = random["numpy"]
    np.random.set_state(("MT19937", keys.numpy(), *rest))  # noqa: NPY002 (the same)
    model.action_space.np_random.bit_generator.state = json.loads(random["actions"])
