"""Hyperparameters of the learning algorithms, and their YAML files.

Observations are already of order 1 and are learnt from as they are. Rewards are in m/s and small; they are multiplied
by one constant, `reward_scale`, so that values are of order 1: unlike running statistics, a constant cannot drift, and
a saved model needs nothing beside it. Actions are learnt as throttles, see `agents.throttle`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, get_args

from pydantic import Field, Strict, model_validator

from formation_env.scenario import config_folder, scenario_names
from formation_env.settings import (
    ConfigError,
    NonNegative,
    Positive,
    Probability,
    Real,
    Text,
    build,
    load_yaml,
    nearest,
    settings,
)

Algorithm = Literal["ppo", "sac"]
ALGORITHMS: Final[tuple[Algorithm, ...]] = get_args(Algorithm)

Share = Annotated[Probability, Field(gt=0)]
Count = Annotated[int, Strict(), Field(ge=1)]
Whole = Annotated[int, Strict(), Field(ge=0)]


@settings
class Network:
    """Layers of the actor and, apart from it, of the critic.

    Attributes:
        hidden: width of each hidden layer.
        activation: what stands between layers.
    """

    hidden: Annotated[tuple[Count, ...], Field(min_length=1)] = (64, 64)
    activation: Literal["tanh", "elu", "relu"] = "tanh"


@settings
class Pretraining:
    """What comes before reinforcement learning, see `agents.pretraining`.

    Attributes:
        teacher: the classical policy that is imitated.
        rounds: flights of imitation; 0 begins with random weights.
        rows: episodes of each.
        updates: gradient steps through the model.
        episodes: recorded episodes that the gradient is taken over.
        batch: of these, in each step.
        learning_rate: greatest; it falls to nearly nothing with the cosine.
    """

    teacher: Text = "lqr"
    rounds: Whole = 3
    rows: Count = 96
    updates: Whole = 300
    episodes: Count = 2048
    batch: Count = 128
    learning_rate: Positive = 1e-3


@settings
class PPOSettings:
    """Proximal policy optimisation (Schulman et al. 2017).

    Attributes:
        rows: environments side by side.
        rollout_steps: steps of each row between updates.
        batch_size: samples of a gradient step.
        epochs: passes over each rollout.
        learning_rate: at the start; it falls linearly to learning_rate_end at the last step.
        learning_rate_end: at the end.
        gamma: discount per step.
        gae_lambda: mix of the advantage estimator (Schulman et al. 2016).
        clip_range: greatest useful change of the probability ratio.
        entropy_coef: weight of the entropy in the loss.
        value_coef: weight of the value error in the loss.
        max_grad_norm: gradients are cut to this norm.
        log_std_init: natural logarithm of the first exploration noise, of the throttle. Noise costs fuel, so it
            starts low.
        reward_scale: rewards are multiplied by this, per m/s.
        throttle_power: p of the thrust sign(z) |z|^p that the network's output z stands for, in units of the greatest.
        network: layers.
    """

    rows: Count = 128
    rollout_steps: Count = 128
    batch_size: Annotated[int, Strict(), Field(ge=2)] = 512
    epochs: Count = 5
    learning_rate: Positive = 7e-4
    learning_rate_end: NonNegative = 3e-5
    gamma: Probability = 0.995
    gae_lambda: Probability = 0.95
    clip_range: Positive = 0.2
    entropy_coef: NonNegative = 0.0
    value_coef: NonNegative = 0.5
    max_grad_norm: Positive = 0.5
    log_std_init: Real = -1.0
    reward_scale: Positive = 3.0
    throttle_power: Positive = 3.0
    network: Network = Network()

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse a rollout that is no whole number of batches: its last one would be small and noisy."""
        samples = self.rows * self.rollout_steps
        if samples % self.batch_size:
            raise ValueError(f"batch_size: must divide rows * rollout_steps = {samples}, got {self.batch_size}")
        return self


@settings
class SACSettings:
    """Soft actor-critic (Haarnoja et al. 2018), with its temperature learnt.

    Attributes:
        rows: environments side by side.
        gradient_steps: updates after each step of all rows.
        batch_size: samples of an update.
        buffer_size: transitions remembered.
        learning_starts: steps flown at random before the first update.
        learning_rate: of actor, critics and temperature.
        gamma: discount per step.
        tau: share by which the target critics follow in each update.
        entropy_init: first temperature.
        target_entropy: entropy of the actions that the temperature aims at, in nats; low, since noise costs fuel.
        reward_scale: rewards are multiplied by this, per m/s.
        throttle_power: p of the thrust sign(z) |z|^p that the network's output z stands for, in units of the greatest.
        network: layers.
    """

    rows: Count = 64
    gradient_steps: Count = 8
    batch_size: Count = 256
    buffer_size: Count = 300_000
    learning_starts: Count = 3_200
    learning_rate: Positive = 1e-3
    gamma: Probability = 0.98
    tau: Share = 0.02
    entropy_init: Positive = 0.01
    target_entropy: Real = -6.0
    reward_scale: Positive = 10.0
    throttle_power: Positive = 3.0
    network: Network = Network(activation="relu")


AgentSettings = PPOSettings | SACSettings
SETTINGS: Final[dict[str, type[PPOSettings] | type[SACSettings]]] = {"ppo": PPOSettings, "sac": SACSettings}
OVERRIDES: Final = "scenarios"
"""Key of a file under which scenarios have hyperparameters of their own."""


def load_settings(algorithm: Algorithm, scenario_name: str, path: Path | None = None) -> AgentSettings:
    """Hyperparameters of an algorithm for a scenario.

    Args:
        algorithm: which.
        scenario_name: its overrides are applied, if the file has some under `scenarios`.
        path: a YAML file; by default configs/agents/ALGORITHM.yaml.

    Raises:
        ConfigError: the file is missing, or any of its keys is wrong; one line per fault, naming file, key and value.
    """
    path = path or config_folder("agents") / f"{algorithm}.yaml"
    data = load_yaml(path)
    if not isinstance(data, Mapping):
        raise ConfigError(f"{path}: (top level): must be a mapping, got {str(data)[:80]}")
    common = {key: value for key, value in data.items() if key != OVERRIDES}
    chosen = build(SETTINGS[algorithm], common, str(path))
    for name, own in _overrides(data, path).items():
        overridden = build(SETTINGS[algorithm], {**common, **own}, f"{path}: {OVERRIDES}.{name}")
        chosen = overridden if name == scenario_name else chosen
    return chosen


def _overrides(data: Mapping[str, Any], path: Path) -> dict[str, Mapping[str, Any]]:
    """Each scenario's own keys, all of them checked to be mappings of scenarios that exist."""
    overrides = data.get(OVERRIDES, {})
    if not isinstance(overrides, Mapping):
        raise ConfigError(f"{path}: {OVERRIDES}: must be a mapping of scenarios, got {str(overrides)[:80]}")
    for name, own in overrides.items():
        if name not in scenario_names():
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: no such scenario; {nearest(str(name), scenario_names())}")
        if not isinstance(own, Mapping):
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: must be a mapping, got {str(own)[:80]}")
    return dict(overrides)
