"""Proximal policy optimisation: hyperparameters and how they become a learner."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, Strict, model_validator

from agents.hyperparameters import CommonSettings, NonNegativeInt, PositiveInt, SearchRange
from formation_env.settings import NonNegative, Positive, Probability, Real, settings

if TYPE_CHECKING:
    pass


@settings
class PPOSettings(CommonSettings):
    """Proximal policy optimisation (Schulman et al. 2017).

    Attributes:
        rollout_steps: steps of each row between updates.
        batch_size: samples of a gradient step.
        epochs: passes over each rollout.
        learning_rate: initial value; it falls linearly to `learning_rate_end` at the last step.
        learning_rate_end: final value.
        gae_lambda: lambda of the advantage estimator (Schulman et al. 2016).
        clip_range: clipping range of the probability ratio.
        target_kl: an update ends early beyond 1.5 times this divergence from the previous policy; 0 disables it.
        entropy_coef: weight of the entropy in the loss.
        value_coef: weight of the value error in the loss.
        max_grad_norm: gradients are clipped to this norm.
        log_std_min: lower limit of the logarithm of the noise.
        warmup_rollouts: rollouts whose updates train the critic alone, so that it does not spoil a pretrained actor.
    """

    learner: ClassVar[str] = "agents.algorithms.ppo_learner"
    stagger_starts: ClassVar[bool] = True
    search_space: ClassVar[Mapping[str, SearchRange]] = MappingProxyType(
        {
            "learning_rate": SearchRange(3e-6, 1e-3),
            "clip_range": SearchRange(0.02, 0.3),
            "gae_lambda": SearchRange(0.8, 1, log=False),
            "entropy_coef": SearchRange(0, 0.01, log=False),
            "log_std_init": SearchRange(-5, -1, log=False),
        }
    )

    rows: PositiveInt = 2048
    rollout_steps: PositiveInt = 32
    batch_size: Annotated[int, Strict(), Field(ge=2)] = 8192
    epochs: PositiveInt = 4
    learning_rate: Positive = 1e-3
    learning_rate_end: NonNegative = 3e-5
    gae_lambda: Probability = 0.95
    clip_range: Positive = 0.2
    target_kl: NonNegative = 0.0
    entropy_coef: NonNegative = 0.0
    value_coef: NonNegative = 0.5
    max_grad_norm: Positive = 0.5
    log_std_min: Real = -5.0
    warmup_rollouts: NonNegativeInt = 0

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse a rollout that is no whole number of batches: the last one would be small and noisy."""
        samples = self.rows * self.rollout_steps
        if samples % self.batch_size:
            raise ValueError(f"batch_size: must divide rows * rollout_steps = {samples}, got {self.batch_size}")
        return self
