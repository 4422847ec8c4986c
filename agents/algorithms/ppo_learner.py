"""PPO for an actor that may already fly well."""

import math

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv

from agents.algorithms.ppo import PPOSettings
from agents.algorithms.throttle_policy import SquashedPolicy, policy_arguments


class CriticFirstPPO(PPO):
    """PPO whose first updates train the critic alone, and whose exploration noise has a lower limit.

    Attributes:
        warmup_steps: rollouts that end at or before this step leave the actor unchanged.
        log_std_min: lower limit of the logarithm of the noise.
    """

    warmup_steps: int = 0
    log_std_min: float = -math.inf

    def train(self) -> None:
        """Update on the last rollout."""
        policy = self.policy
        for part in (*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std):
            part.requires_grad_(self.num_timesteps > self.warmup_steps)
        super().train()
        with torch.no_grad():
            policy.log_std.clamp_(min=self.log_std_min)


def make_model(settings: PPOSettings, env: VecEnv, seed: int) -> PPO:
    """Build the learner; `seed` determines initial weights and exploration."""
    model = CriticFirstPPO(
        SquashedPolicy,
        env,
        n_steps=settings.rollout_steps,
        batch_size=settings.batch_size,
        n_epochs=settings.epochs,
        learning_rate=LinearSchedule(settings.learning_rate, settings.learning_rate_end, 1.0),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        target_kl=settings.target_kl or None,
        ent_coef=settings.entropy_coef,
        vf_coef=settings.value_coef,
        max_grad_norm=settings.max_grad_norm,
        use_sde=settings.use_sde,
        sde_sample_freq=settings.sde_sample_freq,
        policy_kwargs=policy_arguments(settings),
        seed=seed,
        device="cpu",
    )
    model.warmup_steps = settings.warmup_rollouts * settings.rollout_steps * settings.rows
    model.log_std_min = settings.log_std_min
    return model
