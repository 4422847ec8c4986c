"""Soft actor-critic: hyperparameters and how they become a learner."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

from pydantic import model_validator

from agents.hyperparameters import (
    CommonSettings,
    Network,
    NonNegativeInt,
    PositiveInt,
    PositiveShare,
    SearchRange,
    Widths,
)
from formation_env.settings import Flag, NonNegative, Positive, Probability, Real, settings
from formation_env.task.scenario import Scenario

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm


@settings(renamed={"share": "probability", "low": "sigma_min", "high": "sigma_max"})
class ExplorationImpulses:
    """Sparse random impulses; most n-step returns contain none and so stay near on-policy.

    Attributes:
        probability: of an impulse in a step.
        sigma_min: standard deviation of the throttle's impulse in the first row.
        sigma_max: in the last row; the rows between form a geometric series.
    """

    probability: PositiveShare = 0.03
    sigma_min: Positive = 0.02
    sigma_max: Positive = 0.3

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse an inverted range."""
        if self.sigma_min > self.sigma_max:
            raise ValueError(f"sigma_min: must be at most sigma_max = {self.sigma_max}, got {self.sigma_min}")
        return self


@settings(renamed={"anchor_weight": "behaviour_regularizer_weight", "kicks": "exploration_impulses"})
class SACSettings(CommonSettings):
    """Soft actor-critic (Haarnoja et al. 2018), with a learnt temperature; see `agents.algorithms.sac_learner`.

    Attributes:
        gradient_steps: updates of the critics after each step of all rows.
        batch_size: samples of each.
        buffer_size: capacity of the replay buffer; its transitions are part of the checkpoint, at 330 bytes each.
        learning_starts: steps flown before the first update: at random, or by a pretrained actor.
        learning_rate: of the critics, initially; it falls linearly to `learning_rate_end` at the last step.
        learning_rate_end: final value.
        tau: step size of the target critics' moving average.
        n_steps: rewards that are summed before the critics are asked for the rest (n-step returns).
        after_state: whether the critics are given the cost and effect of a thrust, see
            `algorithms.afterstate_critic`.
        critic_hidden: width of each hidden layer of the critics.
        entropy_init: initial temperature.
        target_entropy: entropy of the throttles that the temperature aims at, in nats; low, since noise costs fuel.
        actor_delay_steps: until this step only the critics learn.
        actor_learning_rate: of actor and temperature, initially; it falls linearly to zero.
        actor_every: updates of the critics for each of the actor.
        actor_batch_size: samples of an actor update.
        behaviour_regularizer_weight: penalty, in scaled rewards, on the squared distance between the throttles and
            those of the pretrained actor.
        exploration_impulses: impulses added to the throttles that are flown; none if left out.
    """

    learner: ClassVar[str] = "agents.algorithms.sac_learner"
    search_space: ClassVar[Mapping[str, SearchRange]] = MappingProxyType(
        {
            "learning_rate": SearchRange(3e-6, 1e-3),
            "tau": SearchRange(1e-3, 0.05),
            "gamma": SearchRange(0.9, 1, log=False),
            "entropy_init": SearchRange(1e-6, 1e-2),
            "target_entropy": SearchRange(-20, 0, log=False),
            "log_std_init": SearchRange(-5, -1, log=False),
        }
    )

    steps: PositiveInt = 200_000
    gradient_steps: PositiveInt = 8
    batch_size: PositiveInt = 256
    buffer_size: PositiveInt = 300_000
    learning_starts: PositiveInt = 3_200
    learning_rate: Positive = 1e-3
    learning_rate_end: NonNegative = 1e-3
    gamma: Probability = 0.98
    tau: PositiveShare = 0.02
    n_steps: PositiveInt = 1
    after_state: Flag = False
    critic_hidden: Widths = (64, 64)
    entropy_init: Positive = 0.01
    target_entropy: Real = -6.0
    actor_delay_steps: NonNegativeInt = 0
    actor_learning_rate: Positive = 1e-3
    actor_every: PositiveInt = 1
    actor_batch_size: PositiveInt = 256
    behaviour_regularizer_weight: NonNegative = 0.0
    exploration_impulses: ExplorationImpulses | None = None
    reward_scale: Positive = 10.0
    network: Network = Network(activation="relu")

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse reward normalisation with critics that assume the thrust's cost."""
        if self.after_state and self.normalise_reward:
            raise ValueError("normalise_reward: must be false with after_state, whose critics assume the thrust's cost")
        return self

    def check_scenario(self, scenario: Scenario) -> None:
        """Refuse after-state critics where the variants of a scenario have no common model."""
        if scenario.domain_randomization and self.after_state:
            raise ValueError("agent.after_state: must be false for a scenario with domain_randomization, got true")

    def on_warm_start(self, model: "BaseAlgorithm") -> None:
        """Regularise towards the pretrained actor."""
        cast(Any, model).regularise_towards_current_actor()  # the learner's own method
