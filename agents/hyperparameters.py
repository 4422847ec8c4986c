"""Hyperparameters of the learning algorithms, and their YAML files.

Observations are already of order 1 and are learnt from as they are. Rewards are in m/s and small; they are multiplied
by one constant, `reward_scale`, so that values are of order 1, or divided by the running deviation of the returns.
Actions are learnt as throttles, see `agents.policy.throttle`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, get_args

from pydantic import Field, Strict, model_validator

from formation_env.settings import (
    ConfigError,
    Flag,
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
from formation_env.task.loading import ENV_IDS, config_folder, scenario_names

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
class CommonSettings:
    """What all algorithms have.

    Attributes:
        steps: environment steps to train for, unless the command says otherwise.
        rows: environments side by side.
        gamma: discount per step.
        throttle_power: p of the thrust sign(z) |z|^p that the network's output z stands for, in units of the greatest.
        magnification: of the errors that the network reads, see `agents.policy.features`.
        log_std_init: natural logarithm of the first exploration noise, of the throttle. Noise costs fuel, so it
            starts low.
        use_sde: whether the noise depends on the state (gSDE, Raffin et al. 2022); PPO draws it once for a rollout, SAC
            at each step.
        sde_sample_freq: steps after which that noise is drawn anew within a rollout; -1 is never.
        reward_scale: rewards are multiplied by this, per m/s.
        normalise_reward: whether they are then divided by the running deviation of the discounted returns.
        shaping_weight: of the potential minus the predicted miss at arrival, (m/s) per m; see `algorithms.shaping`.
        bootstrap_end: whether the plan's end counts as an interruption, with the value of the last observation behind
            it, and not as the end that it is.
        network: layers.
        pretraining: what comes before; none if it is left out.
    """

    steps: Count = 2_000_000
    rows: Count = 64
    gamma: Probability = 0.995
    throttle_power: Positive = 2.0
    magnification: Positive = 50.0
    log_std_init: Real = -1.0
    use_sde: Flag = False
    sde_sample_freq: Annotated[int, Strict(), Field(ge=-1)] = -1
    reward_scale: Positive = 3.0
    normalise_reward: Flag = False
    shaping_weight: NonNegative = 0.0
    bootstrap_end: Flag = False
    network: Network = Network()
    pretraining: Pretraining | None = None


@settings
class PPOSettings(CommonSettings):
    """Proximal policy optimisation (Schulman et al. 2017).

    Attributes:
        rollout_steps: steps of each row between updates.
        batch_size: samples of a gradient step.
        epochs: passes over each rollout.
        learning_rate: at the start; it falls linearly to learning_rate_end at the last step.
        learning_rate_end: at the end.
        gae_lambda: mix of the advantage estimator (Schulman et al. 2016).
        clip_range: greatest useful change of the probability ratio.
        target_kl: an update ends early beyond 1.5 times this divergence from the policy before; 0 is never.
        entropy_coef: weight of the entropy in the loss.
        value_coef: weight of the value error in the loss.
        max_grad_norm: gradients are cut to this norm.
        log_std_min: the logarithm of the noise does not fall below this.
        warmup_rollouts: the first updates are of the critic alone, so that it does not spoil an actor it starts from.
    """

    rows: Count = 2048
    rollout_steps: Count = 32
    batch_size: Annotated[int, Strict(), Field(ge=2)] = 8192
    epochs: Count = 4
    learning_rate: Positive = 1e-3
    learning_rate_end: NonNegative = 3e-5
    gae_lambda: Probability = 0.95
    clip_range: Positive = 0.2
    target_kl: NonNegative = 0.0
    entropy_coef: NonNegative = 0.0
    value_coef: NonNegative = 0.5
    max_grad_norm: Positive = 0.5
    log_std_min: Real = -5.0
    warmup_rollouts: Whole = 0

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse a rollout that is no whole number of batches: its last one would be small and noisy."""
        samples = self.rows * self.rollout_steps
        if samples % self.batch_size:
            raise ValueError(f"batch_size: must divide rows * rollout_steps = {samples}, got {self.batch_size}")
        return self


@settings
class Kicks:
    """Strong thrusts at random, seldom enough for the returns between them to be those of the actor.

    Attributes:
        share: of the steps that are kicked.
        low: standard deviation of what is added to the throttles in the first row.
        high: in the last; those of the rows between are a geometric series.
    """

    share: Share = 0.03
    low: Positive = 0.02
    high: Positive = 0.3


@settings
class SACSettings(CommonSettings):
    """Soft actor-critic (Haarnoja et al. 2018), with its temperature learnt; see `agents.algorithms.sac`.

    Attributes:
        gradient_steps: updates of the critics after each step of all rows.
        batch_size: samples of each.
        buffer_size: transitions remembered; those there are stand in the checkpoint, too, at 330 bytes each.
        learning_starts: steps flown before the first update: at random, or by the actor that the run starts from.
        learning_rate: of the critics, at the start; it falls linearly to learning_rate_end at the last step.
        learning_rate_end: at the end.
        tau: share by which the target critics follow in each update.
        n_steps: rewards that are summed up before the critics are asked for the rest.
        after_state: whether critics know what a thrust costs and where it leads, see `algorithms.afterstate_critic`.
        critic_hidden: width of each hidden layer of the critics.
        entropy_init: first temperature.
        target_entropy: entropy of the throttles that the temperature aims at, in nats; low, since noise costs fuel.
        actor_delay_steps: up to this step the critics alone learn.
        actor_learning_rate: of actor and temperature, at first; it falls linearly to nothing.
        actor_every: updates of the critics for each of the actor.
        actor_batch_size: samples of that.
        anchor_weight: price, in scaled rewards, of the squared distance of throttles from those of the actor that the
            run starts from.
        kicks: added to the throttles that are flown; none if it is left out.
    """

    steps: Count = 200_000
    gradient_steps: Count = 8
    batch_size: Count = 256
    buffer_size: Count = 300_000
    learning_starts: Count = 3_200
    learning_rate: Positive = 1e-3
    learning_rate_end: NonNegative = 1e-3
    gamma: Probability = 0.98
    tau: Share = 0.02
    n_steps: Count = 1
    after_state: Flag = False
    critic_hidden: Annotated[tuple[Count, ...], Field(min_length=1)] = (64, 64)
    entropy_init: Positive = 0.01
    target_entropy: Real = -6.0
    actor_delay_steps: Whole = 0
    actor_learning_rate: Positive = 1e-3
    actor_every: Count = 1
    actor_batch_size: Count = 256
    anchor_weight: NonNegative = 0.0
    kicks: Kicks | None = None
    reward_scale: Positive = 10.0
    network: Network = Network(activation="relu")

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse what does not go together."""
        if self.after_state and self.normalise_reward:
            raise ValueError("normalise_reward: must be false with after_state, which knows what thrust costs")
        if self.kicks is not None and self.kicks.low > self.kicks.high:
            raise ValueError(f"kicks.low: must be at most kicks.high = {self.kicks.high}, got {self.kicks.low}")
        return self


AgentSettings = PPOSettings | SACSettings
SETTINGS: Final[dict[str, type[PPOSettings] | type[SACSettings]]] = {"ppo": PPOSettings, "sac": SACSettings}
OVERRIDES: Final = "environments"
"""Key of a file under which environments have hyperparameters of their own."""


def load_settings(algorithm: Algorithm, env: str, path: Path | None = None) -> AgentSettings:
    """Hyperparameters of an algorithm for an environment.

    Args:
        algorithm: which.
        env: a registered id or a scenario's name; its overrides are applied, if the file has some under `environments`.
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
        chosen = overridden if ENV_IDS.get(name, name) == ENV_IDS.get(env, env) else chosen
    return chosen


def _overrides(data: Mapping[str, Any], path: Path) -> dict[str, Mapping[str, Any]]:
    """Each environment's own keys, all of them checked to be mappings of ids or scenarios that exist."""
    overrides = data.get(OVERRIDES, {})
    if not isinstance(overrides, Mapping):
        raise ConfigError(f"{path}: {OVERRIDES}: must be a mapping of environments, got {str(overrides)[:80]}")
    known = [*ENV_IDS, *scenario_names()]
    for name, own in overrides.items():
        if name not in known:
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: no such environment; {nearest(str(name), known)}")
        if not isinstance(own, Mapping):
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: must be a mapping, got {str(own)[:80]}")
    return dict(overrides)
