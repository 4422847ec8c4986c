"""SAC fine-tuning of a pretrained actor."""

import copy
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import LinearSchedule, polyak_update, update_learning_rate
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn
from torch.nn import functional

from agents.algorithms.afterstate_critic import AfterStatePolicy, ThrustCost
from agents.algorithms.sac import SACSettings
from agents.algorithms.throttle_policy import ThrottleSACPolicy, policy_arguments
from agents.algorithms.vec_env import batched_env


class CriticFirstSAC(SAC):
    """SAC whose critics learn first, and whose actor learns slowly and stays near its pretrained state.

    It differs from SB3's: the critics may start earlier, be updated more often and have their own learning rate; they
    are fitted with Huber's loss, since a few episodes far off cost a hundred times the rest; targets and actor use the
    critics' mean; sparse impulses are added to the flown throttles; and the squared distance from the pretrained
    actor's throttles is part of the actor's loss.

    Attributes:
        settings: hyperparameters.
        random_start: whether the steps before the first update are flown at random, and not by the actor.
        behaviour: pretrained network from features to outputs; None after random initial weights.
    """

    settings: SACSettings
    random_start: bool = True
    behaviour: nn.Module | None = None

    def regularise_towards_current_actor(self) -> None:
        """Make the actor, as it is now, the reference of the regulariser, and let it fly from the first step on."""
        self.behaviour = copy.deepcopy(nn.Sequential(self.actor.latent_pi, self.actor.mu)).requires_grad_(False)
        self.random_start = False

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Update the critics, and at every `actor_every`-th step the actor, on samples of the replay buffer."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.critic.optimizer)
        actor_steps = self.num_timesteps - self.settings.actor_delay_steps
        losses: dict[str, list[float]] = {"critic_loss": [], "actor_loss": []}
        for update in range(self._n_updates, self._n_updates + gradient_steps):
            losses["critic_loss"].append(self._update_critics(self._sample(batch_size)))
            if actor_steps > 0 and update % self.settings.actor_every == 0:
                self._set_actor_learning_rate(
                    1 - actor_steps / (self._total_timesteps - self.settings.actor_delay_steps)
                )
                losses["actor_loss"].append(self._update_actor(self._sample(self.settings.actor_batch_size)))
        self._n_updates += gradient_steps
        for name, values in losses.items():
            if values:
                self.logger.record(f"train/{name}", np.mean(values))

    def _sample(self, count: int) -> ReplayBufferSamples:
        assert self.replay_buffer is not None, "SB3 makes it with the model"
        return self.replay_buffer.sample(count, env=self._vec_normalize_env)

    def _set_actor_learning_rate(self, share_left: float) -> None:
        """Lower the learning rate of actor and temperature linearly to zero."""
        assert self.ent_coef_optimizer is not None, "make_model asks for a learnt temperature"
        for optimizer in (self.actor.optimizer, self.ent_coef_optimizer):
            update_learning_rate(optimizer, self.settings.actor_learning_rate * max(share_left, 0.0))

    def _update_critics(self, data: ReplayBufferSamples) -> float:
        """One step towards r + gamma (Q' - alpha log pi), r and gamma being those of n steps."""
        if self.use_sde:
            self.actor.reset_noise()
        with torch.no_grad():
            actions, log_prob = self.actor.action_log_prob(data.next_observations)
            following = _mean(self.critic_target(data.next_observations, actions))
            following -= self._log_temperature.exp() * log_prob.reshape(-1, 1)
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
        penalty = self._behaviour_penalty(mean, data.observations)
        loss = (self._log_temperature.detach().exp() * log_prob - values + penalty).mean()
        _descend(self.actor.optimizer, loss)
        assert self.ent_coef_optimizer is not None, "make_model asks for a learnt temperature"
        entropy_gap = log_prob.detach() + self.settings.target_entropy
        _descend(self.ent_coef_optimizer, -(self._log_temperature * entropy_gap).mean())
        return loss.item()

    @property
    def _log_temperature(self) -> Tensor:
        assert self.log_ent_coef is not None, "make_model asks for a learnt temperature"
        return self.log_ent_coef

    def _behaviour_penalty(self, mean: Tensor, observations: Tensor) -> Tensor:
        """Penalty (rows,) on the distance of the throttles tanh(mean) from the pretrained actor's."""
        if self.behaviour is None:
            return torch.zeros(len(mean))
        reference = self.behaviour(self.actor.extract_features(observations, self.actor.features_extractor))
        weight = self.settings.behaviour_regularizer_weight
        penalty: Tensor = weight * ((mean.tanh() - reference.tanh()) ** 2).sum(dim=1)
        return penalty

    def _sample_action(
        self, learning_starts: int, action_noise: ActionNoise | None = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        action, stored = super()._sample_action(learning_starts if self.random_start else 0, action_noise, n_envs)
        return (action, stored) if self.settings.exploration_impulses is None else self._with_impulses(stored)

    def _with_impulses(self, throttles: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Throttles (rows, 3) plus the rows' impulses, once to be flown and once for the replay buffer."""
        rng, impulses = self.action_space.np_random, self.settings.exploration_impulses
        assert impulses is not None, "checked by the caller"
        fires = rng.random(len(throttles)) < impulses.probability
        sigmas = np.geomspace(impulses.sigma_min, impulses.sigma_max, len(throttles)) * fires
        flown = (throttles + sigmas[:, None] * rng.standard_normal(throttles.shape)).clip(-1, 1).astype(np.float32)
        return flown, flown

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "behaviour"]


def make_model(settings: SACSettings, env: VecEnv, seed: int) -> SAC:
    """Build the learner; `seed` determines initial weights and exploration."""
    model = CriticFirstSAC(
        AfterStatePolicy if settings.after_state else ThrottleSACPolicy,
        env,
        train_freq=1,
        gradient_steps=settings.gradient_steps,
        batch_size=settings.batch_size,
        buffer_size=settings.buffer_size,
        learning_starts=settings.learning_starts,
        learning_rate=LinearSchedule(settings.learning_rate, settings.learning_rate_end, 1.0),
        gamma=settings.gamma,
        tau=settings.tau,
        n_steps=settings.n_steps,
        ent_coef=f"auto_{settings.entropy_init}",
        target_entropy=settings.target_entropy,
        use_sde=settings.use_sde,
        sde_sample_freq=settings.sde_sample_freq,
        policy_kwargs=_policy_arguments(settings, env),
        seed=seed,
        device="cpu",
    )
    if not settings.use_sde:  # with gSDE SB3 does this itself
        last: Any = model.actor.log_std
        nn.init.zeros_(last.weight)
        nn.init.constant_(last.bias, settings.log_std_init)
    model.settings = settings
    return model


def _policy_arguments(settings: SACSettings, env: VecEnv) -> dict[str, Any]:
    """Arguments of the policy's constructor."""
    arguments = policy_arguments(settings)
    # SB3 clips the mean of gSDE at 2; unclipped, the actor in the file is the one that is trained.
    arguments["clip_mean"] = 0.0
    arguments["net_arch"] = {"pi": list(settings.network.hidden), "qf": list(settings.critic_hidden)}
    if settings.after_state:
        scenario = batched_env(env).batch.scenario
        full_thrust_cost = settings.reward_scale * scenario.spacecraft.max_accel_m_s2 * scenario.dt_s
        arguments["thrust_cost"] = ThrustCost(scenario, settings.throttle_power, full_thrust_cost)
    return arguments


def _mean(values: tuple[Tensor, ...]) -> Tensor:
    """Mean (rows, 1) of the critics' values."""
    return torch.cat(values, dim=1).mean(dim=1, keepdim=True)


def _descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call] # torch leaves it untyped
    optimizer.step()
