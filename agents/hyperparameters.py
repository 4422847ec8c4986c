"""Hyperparameters that all learning algorithms share, and what an algorithm is.

Observations are already of order 1 and are used unchanged. Rewards are small numbers in m/s; they are multiplied by one
constant, `reward_scale`, so that values are of order 1, or divided by the running deviation of the returns. Actions
are learnt as throttles, see `agents.policy.throttle`.

An algorithm is a subclass of `CommonSettings`: its hyperparameters are the fields, and its class attributes and methods
say how it is trained. `agents.algorithms.registry` lists them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

from pydantic import Field, Strict

from formation_env.settings import Flag, NonNegative, Positive, Probability, Real, Text, settings
from formation_env.task.scenario import Scenario

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

PositiveShare = Annotated[Probability, Field(gt=0)]
PositiveInt = Annotated[int, Strict(), Field(ge=1)]
NonNegativeInt = Annotated[int, Strict(), Field(ge=0)]
Widths = Annotated[tuple[PositiveInt, ...], Field(min_length=1)]

VALIDATIONS: Final = 20
"""Validations of a training by default: enough points for a learning curve, few enough to cost little time."""
VALIDATION_EPISODES: Final = 64
"""Episodes of each validation by default. All validations fly the same seeds, so their differences scatter little."""


@dataclass(frozen=True)
class SearchRange:
    """Interval in which tuning searches a hyperparameter.

    Attributes:
        low: lower limit.
        high: upper limit.
        log: whether the logarithm is sampled uniformly, else the value.
    """

    low: float
    high: float
    log: bool = True


@settings
class Network:
    """Layers of the actor and of a critic that is separate from it.

    Attributes:
        hidden: width of each hidden layer.
        activation: nonlinearity after each hidden layer.
    """

    hidden: Widths = (64, 64)
    activation: Literal["tanh", "elu", "relu"] = "tanh"


@settings
class Pretraining:
    """Imitation and model-based policy optimisation before reinforcement learning, see `agents.pretraining`.

    Attributes:
        teacher: classical policy to imitate.
        rounds: DAgger rounds of imitation; 0 keeps the random initial weights.
        rows: episodes of each round.
        updates: gradient steps through the model.
        episodes: recorded episodes that the gradient is averaged over.
        batch: episodes of each gradient step.
        learning_rate: peak value; a cosine schedule lowers it to 1 % of that.
    """

    teacher: Text = "lqr"
    rounds: NonNegativeInt = 3
    rows: PositiveInt = 96
    updates: NonNegativeInt = 300
    episodes: PositiveInt = 2048
    batch: PositiveInt = 128
    learning_rate: Positive = 1e-3

    @property
    def training_episodes(self) -> int:
        """Training seeds that imitation and the recorded episodes take together."""
        return self.rows * self.rounds + self.episodes


@settings
class CommonSettings:
    """Hyperparameters of every algorithm; a subclass adds its own and says how to build the learner.

    Attributes:
        steps: environment steps to train for, unless the command line gives another number.
        rows: environments stepped side by side.
        gamma: discount per step.
        throttle_power: p of the thrust sign(z) |z|^p for the network's output z, in units of the maximum thrust.
        magnification: factor of the errors in the network's input, see `agents.policy.features`.
        log_std_init: natural logarithm of the initial exploration noise of the throttle. Noise costs fuel, so it
            starts low.
        use_sde: whether the noise depends on the state (gSDE, Raffin et al. 2022); PPO draws it once for a rollout, SAC
            at each step.
        sde_sample_freq: steps after which that noise is drawn anew within a rollout; -1 is never.
        reward_scale: factor of the rewards, per m/s.
        normalise_reward: whether rewards are also divided by the running deviation of the discounted returns.
        shaping_weight: weight of the potential, minus the predicted miss at arrival, (m/s) per m; see
            `algorithms.shaping`.
        bootstrap_end: whether the end of the episode counts as a truncation, bootstrapped with the value of the last
            observation, and not as a termination.
        network: layers.
        pretraining: settings of the pretraining; none if left out.
    """

    learner: ClassVar[str] = ""
    """Module whose `make_model(settings, env, seed)` builds the learner; it needs torch, so it is imported on use."""
    stagger_starts: ClassVar[bool] = False
    """Whether the rows' episodes begin spread over an episode's length, so that a rollout sees every phase."""
    search_space: ClassVar[Mapping[str, SearchRange]] = MappingProxyType({})
    """Hyperparameters that `tune` searches; pretraining has none, since all trials share it."""

    steps: PositiveInt = 2_000_000
    rows: PositiveInt = 64
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

    def make_model(self, env: "VecEnv", seed: int) -> "BaseAlgorithm":
        """Build a Stable-Baselines3 model on `env`; `seed` determines initial weights and exploration."""
        if not self.learner:
            raise NotImplementedError(f"{type(self).__name__}: give it make_model, or the name of its learner's module")
        model: BaseAlgorithm = import_module(self.learner).make_model(self, env, seed)
        return model

    def check_scenario(self, scenario: Scenario) -> None:
        """Refuse a scenario that the hyperparameters cannot train on.

        Raises:
            ValueError: naming the hyperparameter.
        """

    def on_warm_start(self, model: "BaseAlgorithm") -> None:
        """Tell the model that its actor has just been replaced by a pretrained one."""
