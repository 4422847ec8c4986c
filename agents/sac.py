"""SAC that begins with an actor which can already fly, and does not spoil it."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import polyak_update, update_learning_rate
from torch import Tensor
from torch.nn import functional


class CriticFirstSAC(SAC):
    """SAC (as in SB3) with what a start near the optimum asks for."""

    actor_delay_steps: int = 0
    random_start: bool = True
    actor_learning_rate: float = 1e-4
    actor_every: int = 1
    actor_batch: int = 256
    anchor_weight: float = 0.0
    noise_scales: NDArray[np.float64] | None = None
    anchor: Any = None

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        self.policy.set_training_mode(True)
        share = self._current_progress_remaining
        update_learning_rate(self.critic.optimizer, self.lr_schedule(share))
        done, total = self.num_timesteps - self.actor_delay_steps, self._total_timesteps - self.actor_delay_steps
        actor_rate = self.actor_learning_rate * max(0.0, 1 - done / max(total, 1))
        for optimizer in (self.actor.optimizer, self.ent_coef_optimizer):
            if optimizer is not None:
                update_learning_rate(optimizer, actor_rate)
        if self.anchor is None:
            import copy
            self.anchor = copy.deepcopy(self.actor)
        c, a = [], []
        for step in range(gradient_steps):
            c.append(self._update_critics(self._sample(batch_size)))
            if done > 0 and (self._n_updates + step) % self.actor_every == 0:
                a.append(self._update_actor(self._sample(self.actor_batch)))
        self._n_updates += gradient_steps
        self.logger.record("train/critic_loss", np.mean(c))
        if a:
            self.logger.record("train/actor_loss", np.mean(a))

    def _sample(self, n: int) -> ReplayBufferSamples:
        return self.replay_buffer.sample(n, env=self._vec_normalize_env)

    def _temperature(self) -> Tensor:
        return self.ent_coef_tensor if self.log_ent_coef is None else self.log_ent_coef.detach().exp()

    def _update_critics(self, data: ReplayBufferSamples) -> float:
        discounts = self.gamma if data.discounts is None else data.discounts
        if self.use_sde:
            self.actor.reset_noise()
        with torch.no_grad():
            actions, log_prob = self.actor.action_log_prob(data.next_observations)
            q = torch.cat(self.critic_target(data.next_observations, actions), dim=1)
            q = q.mean(dim=1, keepdim=True) if self.mean_target else q.min(dim=1, keepdim=True).values
            target = data.rewards + (1 - data.dones) * discounts * (q - self._temperature() * log_prob.reshape(-1, 1))
        loss = sum(functional.smooth_l1_loss(q, target) for q in self.critic(data.observations, data.actions))
        self.critic.optimizer.zero_grad()
        loss.backward()
        self.critic.optimizer.step()
        polyak_update(self.critic.parameters(), self.critic_target.parameters(), self.tau)
        return loss.item()

    def _update_actor(self, data: ReplayBufferSamples) -> float:
        mean, log_std, kwargs = self.actor.get_action_dist_params(data.observations)
        actions, log_prob = self.actor.action_dist.log_prob_from_params(mean, log_std, **kwargs)
        q = torch.cat(self.critic(data.observations, actions), dim=1)
        q = q.mean(dim=1) if self.mean_target else q.min(dim=1).values
        loss = (self._temperature() * log_prob - q).mean()
        if self.anchor_weight:
            with torch.no_grad():
                there = self.anchor.get_action_dist_params(data.observations)[0].tanh()
            loss = loss + self.anchor_weight * ((mean.tanh() - there) ** 2).sum(dim=1).mean()
        self.actor.optimizer.zero_grad()
        loss.backward()
        self.actor.optimizer.step()
        if self.log_ent_coef is not None:
            ent = -(self.log_ent_coef * (log_prob + self.target_entropy).detach()).mean()
            self.ent_coef_optimizer.zero_grad()
            ent.backward()
            self.ent_coef_optimizer.step()
        return loss.item()

    mean_target: bool = False
    noise_share: float = 1.0

    def _sample_action(
        self, learning_starts: int, action_noise: ActionNoise | None = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        action, kept = super()._sample_action(learning_starts if self.random_start else 0, action_noise, n_envs)
        if self.noise_scales is None:
            return action, kept
        rng = self.action_space.np_random
        noise = rng.normal(size=kept.shape) * (self.noise_scales * (rng.random(len(kept)) < self.noise_share))[:, None]
        kept = np.clip(kept + noise, -1, 1).astype(np.float32)
        return kept, kept
