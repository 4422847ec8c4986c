"""From hyperparameters to Stable-Baselines3's environments and algorithms."""

import math
from typing import Any, Final

import torch
from gymnasium import spaces
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import Schedule
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import nn

from agents.algorithms.afterstate_critic import AfterStatePolicy, Known
from agents.algorithms.sac import CriticFirstSAC
from agents.algorithms.shaping import Shaping
from agents.algorithms.vec_env import Sb3VecEnv
from agents.hyperparameters import AgentSettings, PPOSettings, SACSettings
from agents.policy.features import CUT, MAGNIFIED
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario

CLASSES: Final[dict[str, type[BaseAlgorithm]]] = {"ppo": PPO, "sac": SAC}
ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": nn.Tanh, "elu": nn.ELU, "relu": nn.ReLU}


class Magnifier(BaseFeaturesExtractor):
    """Shows a network an observation as `agents.policy.features` does; nothing in it is learnt."""

    def __init__(self, observation_space: spaces.Box, magnification: float) -> None:
        super().__init__(observation_space, SIZE)
        factors = torch.ones(SIZE)
        factors[MAGNIFIED] = magnification
        self.register_buffer("factors", factors, persistent=False)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features (rows, SIZE) of observations (rows, SIZE)."""
        return (observations * self.factors).clamp(-CUT, CUT)


class SquashedPolicy(ActorCriticPolicy):
    """SB3's "MlpPolicy" for PPO, its mean brought to [-1, 1] by tanh as SAC's is: one pretrained actor serves both."""

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self.action_net.register_forward_hook(lambda layer, given, mean: mean.tanh())


class CriticFirstPPO(PPO):
    """PPO whose first updates are the critic's alone, and whose exploration does not collapse.

    Attributes:
        warmup_steps: rollouts that end up to this step leave the actor as it is.
        log_std_min: the logarithm of the noise does not fall below this.
    """

    warmup_steps: int = 0
    log_std_min: float = -math.inf

    def train(self) -> None:
        """Update on the rollout just flown."""
        policy = self.policy
        for part in (*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std):
            part.requires_grad_(self.num_timesteps > self.warmup_steps)
        super().train()
        with torch.no_grad():
            policy.log_std.clamp_(min=self.log_std_min)


def make_env(agent: AgentSettings, scenario: Scenario) -> VecEnv:
    """The environment to learn on."""
    shaping = Shaping(scenario, agent.shaping_weight, agent.gamma) if agent.shaping_weight else None
    env = Sb3VecEnv(
        agent.rows,
        scenario,
        reward_scale=agent.reward_scale,
        throttle_power=agent.throttle_power,
        shaping=shaping,
        bootstrap_end=agent.bootstrap_end,
        stagger=isinstance(agent, PPOSettings),  # a replay buffer mixes the parts of a mission anyway
    )
    return VecNormalize(env, norm_obs=False, gamma=agent.gamma) if agent.normalise_reward else env


def make_model(agent: AgentSettings, env: VecEnv, seed: int) -> BaseAlgorithm:
    """A new model; `seed` is SB3's, of the network's first weights and of the exploration."""
    return _ppo(agent, env, seed) if isinstance(agent, PPOSettings) else _sac(agent, env, seed)


def _ppo(agent: PPOSettings, env: VecEnv, seed: int) -> PPO:
    model = CriticFirstPPO(
        SquashedPolicy,
        env,
        n_steps=agent.rollout_steps,
        batch_size=agent.batch_size,
        n_epochs=agent.epochs,
        learning_rate=LinearSchedule(agent.learning_rate, agent.learning_rate_end, 1.0),
        gamma=agent.gamma,
        gae_lambda=agent.gae_lambda,
        clip_range=agent.clip_range,
        target_kl=agent.target_kl or None,
        ent_coef=agent.entropy_coef,
        vf_coef=agent.value_coef,
        max_grad_norm=agent.max_grad_norm,
        use_sde=agent.use_sde,
        sde_sample_freq=agent.sde_sample_freq,
        policy_kwargs=_layers(agent) | {"log_std_init": agent.log_std_init},
        seed=seed,
        device="cpu",
    )
    model.warmup_steps = agent.warmup_rollouts * agent.rollout_steps * agent.rows
    model.log_std_min = agent.log_std_min
    return model


def _sac(agent: SACSettings, env: VecEnv, seed: int) -> SAC:
    # SB3 cuts the mean of gSDE off at 2, which would be another actor than the one in the file.
    own: dict[str, Any] = {"log_std_init": agent.log_std_init, "clip_mean": 0.0}
    own["net_arch"] = {"pi": list(agent.network.hidden), "qf": list(agent.critic_hidden)}
    if agent.after_state:
        scenario = env.unwrapped.batch.scenario
        price = agent.reward_scale * scenario.spacecraft.max_accel_m_s2 * scenario.dt_s
        own["known"] = Known(scenario, agent.throttle_power, price)
    model = CriticFirstSAC(
        AfterStatePolicy if agent.after_state else "MlpPolicy",
        env,
        train_freq=1,
        gradient_steps=agent.gradient_steps,
        batch_size=agent.batch_size,
        buffer_size=agent.buffer_size,
        learning_starts=agent.learning_starts,
        learning_rate=LinearSchedule(agent.learning_rate, agent.learning_rate_end, 1.0),
        gamma=agent.gamma,
        tau=agent.tau,
        n_steps=agent.n_steps,
        ent_coef=f"auto_{agent.entropy_init}",
        target_entropy=agent.target_entropy,
        use_sde=agent.use_sde,
        sde_sample_freq=agent.sde_sample_freq,
        policy_kwargs=_layers(agent) | own,
        seed=seed,
        device="cpu",
    )
    if not agent.use_sde:  # else SB3 does it
        nn.init.zeros_(model.actor.log_std.weight)
        nn.init.constant_(model.actor.log_std.bias, agent.log_std_init)
    model.how = agent
    return model


def _layers(agent: AgentSettings) -> dict[str, Any]:
    return {
        "net_arch": list(agent.network.hidden),
        "activation_fn": ACTIVATIONS[agent.network.activation],
        "features_extractor_class": Magnifier,
        "features_extractor_kwargs": {"magnification": agent.magnification},
    }
