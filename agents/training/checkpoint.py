"""The complete state of a training in one file, from which a killed training continues with the same bits.

The file begins with a line that holds the SHA-256 of what follows, so that damage is noticed. What follows are tensors,
numbers and texts, read with torch's `weights_only`: nothing in it is executed. Left out are only the running means of
episodes that TensorBoard shows.
"""

import hashlib
import io
import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from agents.algorithms.vec_env import batched_env
from agents.training.run_folder import Run, run_sha256
from formation_env.files import replacing
from formation_env.settings import ConfigError

State = dict[str, Any]

MAGIC: Final = b"formation-env checkpoint 1 sha256 "
"""Start of the first line; the digest in hexadecimal digits completes it."""
HEADER_BYTES: Final = len(MAGIC) + 64 + 1
KEYS: Final = ("run", "notes", "parameters", "counters", "rows", "observations", "starts", "random")
"""Entries of every checkpoint; a model with a replay buffer or normalised rewards has more."""
COUNTERS: Final = ("num_timesteps", "_n_updates", "_episode_num")
BUFFER_ARRAYS: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of a replay buffer, (transitions of a row, rows, ...)."""


def save_checkpoint(path: Path, model: BaseAlgorithm, run: Run, notes: State) -> None:
    """Write the state of a model between two rollouts; if interrupted, the old file remains.

    Args:
        path: of the file.
        model: with its environment.
        run: settings of the training, by which a checkpoint of another run is refused.
        notes: further plain values to keep.

    Raises:
        OSError: the folder cannot be written.
    """
    vec_env = model.get_env()
    assert vec_env is not None, "a model in training has an environment"
    assert model._last_obs is not None, "checkpoints are written between rollouts"
    state: State = {
        "run": run_sha256(run),
        "notes": notes,
        "parameters": model.get_parameters(),
        "counters": {name: getattr(model, name) for name in COUNTERS},
        "rows": torch.from_numpy(batched_env(vec_env).memory()),
        "observations": torch.from_numpy(model._last_obs),
        "starts": torch.from_numpy(model._last_episode_starts),
        "random": _random_state(model),
    }
    if isinstance(vec_env, VecNormalize):
        deviation = vec_env.ret_rms
        state["returns"] = [float(deviation.mean), float(deviation.var), float(deviation.count)]
        state["discounted"] = torch.from_numpy(vec_env.returns)
    if isinstance(model, SAC) and model.log_ent_coef is not None:
        state["log_ent_coef"] = model.log_ent_coef.detach()
    if isinstance(model, OffPolicyAlgorithm):
        state["replay"] = _replay_state(_replay_buffer(model))
    content = io.BytesIO()
    torch.save(state, content)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(_header(content.getbuffer()))
        file.write(content.getbuffer())


def _header(content: bytes | memoryview) -> bytes:
    """First line of the file."""
    return MAGIC + hashlib.sha256(content).hexdigest().encode() + b"\n"


def load_checkpoint(path: Path, run: Run) -> State:
    """Read a state written by `save_checkpoint`.

    Raises:
        ConfigError: the file cannot be read, is damaged, or belongs to another run; one line.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    header, body = content[:HEADER_BYTES], content[HEADER_BYTES:]
    if not header.startswith(MAGIC):
        raise ConfigError(f"{path}: damaged, or not a checkpoint of this version")
    if header != _header(body):
        raise ConfigError(f"{path}: damaged: its content does not have the SHA-256 in its first line")
    state = _unpack(path, body)
    if state["run"] != run_sha256(run):
        raise ConfigError(f"{path}: is the checkpoint of another run, whose settings differ from this folder's")
    return state


def _unpack(path: Path, content: bytes) -> State:
    """Read tensors, numbers and texts; whatever else is in the file is refused and not executed."""
    try:
        state = torch.load(io.BytesIO(content), weights_only=True)
    except Exception as error:  # torch raises errors of a dozen types for files that it did not write
        raise ConfigError(f"{path}: is not a checkpoint: {' '.join(str(error).split())[:80]}") from None
    missing = [key for key in KEYS if not isinstance(state, dict) or key not in state]
    if missing:
        raise ConfigError(f"{path}: is not a checkpoint: {missing[0]}: missing")
    return dict(state)


def restore(model: BaseAlgorithm, state: State) -> None:
    """Put a new model of the same settings, and its environment, into the state of a checkpoint.

    Random states are restored later by `restore_random`, since steps before the next rollout would consume them.
    """
    vec_env = model.get_env()
    assert vec_env is not None, "a model in training has an environment"
    model.set_parameters(state["parameters"])
    for name, value in state["counters"].items():
        setattr(model, name, value)
    observations = state["observations"].numpy()
    batched_env(vec_env).recall(state["rows"].numpy(), observations)
    model._last_obs = model._last_original_obs = observations
    model._last_episode_starts = state["starts"].numpy()
    if isinstance(vec_env, VecNormalize):
        deviation = vec_env.ret_rms
        deviation.mean, deviation.var, deviation.count = state["returns"]
        vec_env.returns = state["discounted"].numpy()
    if isinstance(model, SAC) and model.log_ent_coef is not None:
        model.log_ent_coef.data.copy_(state["log_ent_coef"])
    if isinstance(model, OffPolicyAlgorithm):
        _refill(_replay_buffer(model), state["replay"])


def _replay_buffer(model: OffPolicyAlgorithm) -> ReplayBuffer:
    assert model.replay_buffer is not None, "SB3 makes it with the model"
    return model.replay_buffer


def _replay_state(buffer: ReplayBuffer) -> State:
    filled = {name: torch.from_numpy(getattr(buffer, name)[: buffer.size()]) for name in BUFFER_ARRAYS}
    return filled | {"pos": buffer.pos, "full": buffer.full}


def _refill(buffer: ReplayBuffer, state: State) -> None:
    buffer.pos, buffer.full = state["pos"], state["full"]
    for name in BUFFER_ARRAYS:
        getattr(buffer, name)[: buffer.size()] = state[name].numpy()


def _random_state(model: BaseAlgorithm) -> State:
    """State of torch's generator and of the two of NumPy that SB3 uses; the environment's are in its rows."""
    _, keys, *rest = np.random.get_state()  # noqa: NPY002 (SB3 shuffles and samples with the global stream)
    return {
        "torch": torch.get_rng_state(),
        "numpy": [torch.from_numpy(keys), *rest],
        "actions": json.dumps(model.action_space.np_random.bit_generator.state),
    }


def restore_random(model: BaseAlgorithm, state: State) -> None:
    """Set all random generators to the state of a checkpoint."""
    random = state["random"]
    torch.set_rng_state(random["torch"])
    keys, *rest = random["numpy"]
    np.random.set_state(("MT19937", keys.numpy(), *rest))  # noqa: NPY002 (as in `_random_state`)
    model.action_space.np_random.bit_generator.state = json.loads(random["actions"])
