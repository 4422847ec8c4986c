"""SAC for an actor that can already fly."""

import copy
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import polyak_update, update_learning_rate
from torch import Tensor, nn
from torch.nn import functional

from agents.hyperparameters import SACSettings


class CriticFirstSAC(SAC):
    """SAC whose critics learn first, and whose actor learns slowly and stays near the one that it began with.

    What differs from SB3's: critics may be ahead of the actor in time, number of updates and learning rate; their
    errors count by Huber's loss, since a few far-off episodes cost a hundred times the rest; targets and actor see the
    critics' mean; some steps of the flights are kicked; and distance from the first actor is part of the actor's loss.

    Attributes:
        how: its hyperparameters.
        random_start: whether the steps before the first update are flown at random, and not by the actor.
        anchor: from features to outputs, as the actor was when it began; None after random weights.
    """

    how: SACSettings
    random_start: bool = True
    anchor: nn.Module | None = None

    def keep_near(self) -> None:
        """Have the actor, as it is now, be the one to stay near to, and to fly from the first step on."""
        self.anchor = copy.deepcopy(nn.Sequential(self.actor.latent_pi, self.actor.mu)).requires_grad_(False)
        self.random_start = False

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Update the critics, and now and then the actor, on what is remembered."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.critic.optimizer)
        late = self.num_timesteps - self.how.actor_delay_steps
        losses: dict[str, list[float]] = {"critic_loss": [], "actor_loss": []}
        for update in range(self._n_updates, self._n_updates + gradient_steps):
            losses["critic_loss"].append(self._update_critics(self._remembered(batch_size)))
            if late > 0 and update % self.how.actor_every == 0:
                self._slow_down(1 - late / (self._total_timesteps - self.how.actor_delay_steps))
                losses["actor_loss"].append(self._update_actor(self._remembered(self.how.actor_batch_size)))
        self._n_updates += gradient_steps
        for name, values in losses.items():
            if values:
                self.logger.record(f"train/{name}", np.mean(values))

    def _remembered(self, count: int) -> ReplayBufferSamples:
        return self.replay_buffer.sample(count, env=self._vec_normalize_env)

    def _slow_down(self, share_left: float) -> None:
        """Have the actor's learning rate fall linearly to nothing."""
        for optimizer in (self.actor.optimizer, self.ent_coef_optimizer):
            update_learning_rate(optimizer, self.how.actor_learning_rate * max(share_left, 0.0))

    def _update_critics(self, data: ReplayBufferSamples) -> float:
        """One step towards r + gamma (Q' - alpha log pi), r and gamma being those of n steps."""
        if self.use_sde:
            self.actor.reset_noise()
        with torch.no_grad():
            actions, log_prob = self.actor.action_log_prob(data.next_observations)
            following = _mean(self.critic_target(data.next_observations, actions))
            following -= self.log_ent_coef.exp() * log_prob.reshape(-1, 1)
            discounts = self.gamma if data.discounts is None else data.discounts
            target = data.rewards + (1 - data.dones) * discounts * following
        values = self.critic(data.observations, data.actions)
        loss = torch.stack([functional.smooth_l1_loss(value, target) for value in values]).sum()
        _descend(self.critic.optimizer, loss)
        polyak_update(self.critic.parameters(), self.critic_target.parameters(), self.tau)
        return loss.item()

    def _update_actor(self, data: ReplayBufferSamples) -> float:
        """One step of actor and temperature."""
        if self.use_sde:
            self.actor.reset_noise()
        mean, log_std, parts = self.actor.get_action_dist_params(data.observations)
        actions, log_prob = self.actor.action_dist.log_prob_from_params(mean, log_std, **parts)
        values = _mean(self.critic(data.observations, actions)).squeeze(1)
        loss = (self.log_ent_coef.detach().exp() * log_prob - values + self._distance(mean, data.observations)).mean()
        _descend(self.actor.optimizer, loss)
        _descend(self.ent_coef_optimizer, -(self.log_ent_coef * (log_prob.detach() + self.target_entropy)).mean())
        return loss.item()

    def _distance(self, mean: Tensor, observations: Tensor) -> Tensor:
        """Price (rows,) of throttles tanh(mean) that differ from those of the actor that it began with."""
        if self.anchor is None:
            return torch.zeros(len(mean))
        begun = self.anchor(self.actor.extract_features(observations, self.actor.features_extractor))
        return self.how.anchor_weight * ((mean.tanh() - begun.tanh()) ** 2).sum(dim=1)

    def _sample_action(
        self, learning_starts: int, action_noise: ActionNoise | None = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        action, kept = super()._sample_action(learning_starts if self.random_start else 0, action_noise, n_envs)
        return (action, kept) if self.how.kicks is None else self._kicked(kept)

    def _kicked(self, throttles: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Throttles (rows, 3) with what the rows' kicks add to some, as they are flown and remembered."""
        rng, kicks = self.action_space.np_random, self.how.kicks
        sizes = np.geomspace(kicks.low, kicks.high, len(throttles)) * (rng.random(len(throttles)) < kicks.share)
        kicked = (throttles + sizes[:, None] * rng.standard_normal(throttles.shape)).clip(-1, 1).astype(np.float32)
        return kicked, kicked

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "anchor"]


def _mean(values: tuple[Tensor, ...]) -> Tensor:
    """The mean (rows, 1) of what the critics say."""
    return torch.cat(values, dim=1).mean(dim=1, keepdim=True)


def _descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
