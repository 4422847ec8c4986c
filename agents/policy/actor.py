"""A learned policy at run time: a small network in numpy, stored in a safetensors file; no torch, no SB3."""

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from agents.policy.features import features
from agents.policy.throttle import throttle
from formation_env.settings import ConfigError, nearest
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario

Array32 = NDArray[np.float32]
Layer = tuple[Array32, Array32]
"""Weights (out, in) and biases (out,)."""

ACTIONS: Final = 3
_ZERO: Final = np.float32(0)
_LOW, _HIGH = np.full(ACTIONS, -1, np.float32), np.full(ACTIONS, 1, np.float32)


def _relu(x: Array32) -> Array32:
    return np.maximum(x, _ZERO)


def _elu(x: Array32) -> Array32:
    return np.maximum(x, _ZERO) + np.expm1(np.minimum(x, _ZERO))


def _clip(x: Array32) -> Array32:
    return np.minimum(np.maximum(x, _LOW), _HIGH)  # faster than np.clip for three numbers


ACTIVATIONS: Final[dict[str, Callable[[Array32], Array32]]] = {"tanh": np.tanh, "relu": _relu, "elu": _elu}
SQUASHES: Final[dict[str, Callable[[Array32], Array32]]] = {"clip": _clip, "tanh": np.tanh}


@dataclass(frozen=True)
class Functions:
    """Functions between and after the layers.

    Attributes:
        activation: one of `ACTIVATIONS`, after every layer except the last.
        squash: one of `SQUASHES`, after the last layer: to [-1, 1].
        throttle_power: p of the thrust sign(z) |z|^p for the squashed output z.
        magnification: factor of the errors in the input, see `agents.policy.features`.
    """

    activation: str
    squash: str
    throttle_power: float
    magnification: float = 1.0

    def __post_init__(self) -> None:
        """Refuse unknown functions and parameters out of range."""
        for name, known in (("activation", ACTIVATIONS), ("squash", SQUASHES)):
            given = getattr(self, name)
            if given not in known:
                raise ConfigError(f"{name}: no such function: {given!r}; {nearest(given, known)}")
        for name in ("throttle_power", "magnification"):
            if not 0 < getattr(self, name) < math.inf:
                raise ConfigError(f"{name}: must be > 0, got {getattr(self, name)}")


class Actor:
    """z = squash(W_L act(... act(W_1 f(o) + b_1)) + b_L), and the action sign(z) |z|^p, in float32.

    Attributes:
        layers: weights and biases, first to last.
        functions: functions between and after them.
        scenario: task that it was trained on.
    """

    def __init__(self, layers: Sequence[Layer], functions: Functions, scenario: Scenario) -> None:
        """Check the layers.

        Raises:
            ConfigError: the layers do not map an observation to an action, or are not finite.
        """
        check_layers(layers)
        self.layers = tuple(layers)
        self.functions = functions
        self.scenario = scenario
        # With transposed weights the same product serves one observation and a batch.
        self._hidden = [(np.ascontiguousarray(weight.T), bias) for weight, bias in layers]
        self._last_weight, self._last_bias = self._hidden.pop()
        self._activation = ACTIVATIONS[functions.activation]
        self._squash = SQUASHES[functions.squash]

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Array32, Any]:
        """Actions for one observation or a batch, with the signature of Stable-Baselines3's policies.

        Args:
            observation: (SIZE,) or (rows, SIZE).
            state: returned unchanged.
            episode_start: ignored.
            deterministic: ignored; the actor is deterministic.

        Returns:
            Actions (3,) or (rows, 3), float32 in [-1, 1], in units of max_accel_m_s2; and `state`.
        """
        x = features(np.asarray(observation, np.float32), self.functions.magnification)
        for weight, bias in self._hidden:
            x = self._activation(np.dot(x, weight) + bias)
        z = self._squash(np.dot(x, self._last_weight) + self._last_bias)
        return throttle(z, self.functions.throttle_power), state


def check_layers(layers: Sequence[Layer]) -> None:
    """Refuse layers that do not map an observation to an action.

    Raises:
        ConfigError: naming the first layer that does not fit.
    """
    if not layers:
        raise ConfigError("layers: there are none")
    for index, pair in enumerate(layers):
        for name, tensor, rank in zip(("weight", "bias"), pair, (2, 1), strict=True):
            if tensor.dtype != np.float32 or tensor.ndim != rank:
                raise ConfigError(
                    f"layers.{index}.{name}: must be float32 of rank {rank}, got {tensor.dtype} {tensor.shape}"
                )
    widths = [SIZE, *(len(weight) for weight, _ in layers[:-1]), ACTIONS]
    for index, ((weight, bias), (inside, outside)) in enumerate(zip(layers, itertools.pairwise(widths), strict=True)):
        for name, tensor, shape in (("weight", weight, (outside, inside)), ("bias", bias, (outside,))):
            if tensor.shape != shape:
                raise ConfigError(f"layers.{index}.{name}: must be float32 {shape}, got {tensor.dtype} {tensor.shape}")
            if not np.isfinite(tensor).all():
                raise ConfigError(f"layers.{index}.{name}: must be finite")


def to_bytes(actor: Actor) -> bytes:
    """Content of an actor's safetensors file: `layers.I.weight` (out, in), `layers.I.bias`, functions as metadata."""
    from safetensors.numpy import save

    tensors: dict[str, Array32] = {}
    for index, (weight, bias) in enumerate(actor.layers):
        tensors |= {f"layers.{index}.weight": np.ascontiguousarray(weight), f"layers.{index}.bias": bias}
    content = bytes(save(tensors, {name: str(value) for name, value in asdict(actor.functions).items()}))
    # The header is JSON after its length; its metadata come in random order, but equal actors must give equal files.
    start, end = 8, 8 + int.from_bytes(content[:8], "little")
    header = json.dumps(json.loads(content[start:end]), sort_keys=True, separators=(",", ":"))
    return content[:start] + header.encode().ljust(end - start) + content[end:]


def read_actor(path: Path, scenario: Scenario) -> Actor:
    """Read an actor from a safetensors file, which holds numbers and no code.

    Args:
        path: of the file.
        scenario: task that it was trained on.

    Raises:
        ConfigError: the file is missing, damaged, or holds no actor; one line.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            names = list(file.keys())
            # numpy has no bfloat16 and no float8: look at the types before reading any tensor
            types = {name: file.get_slice(name).get_dtype() for name in names}
            for name in names:
                if types[name] != "F32":
                    raise ConfigError(f"{path}: {name}: must be float32, got {types[name]}")
            tensors = {name: file.get_tensor(name) for name in names}
            metadata = file.metadata() or {}
    except ConfigError:
        raise
    except (OSError, SafetensorError, ValueError, TypeError) as error:
        raise ConfigError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
    try:
        functions = Functions(
            metadata["activation"],
            metadata["squash"],
            float(metadata["throttle_power"]),
            float(metadata["magnification"]),
        )
        return Actor(_layers(tensors), functions, scenario)
    except KeyError as error:
        raise ConfigError(f"{path}: {error.args[0]}: missing, so this is no actor") from None
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from None


def _layers(tensors: Mapping[str, Array32]) -> list[Layer]:
    """Sort the tensors into layers.

    Raises:
        KeyError: one is missing.
        ConfigError: a tensor belongs to no layer.
    """
    count = len(tensors) // 2
    layers = [(tensors[f"layers.{index}.weight"], tensors[f"layers.{index}.bias"]) for index in range(count)]
    if len(tensors) != 2 * count:
        raise ConfigError(f"tensors: must be a weight and a bias for each layer, got {sorted(tensors)}")
    return layers
