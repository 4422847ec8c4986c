"""From hyperparameters to Stable-Baselines3's algorithms."""

from typing import Any, Final

from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv
from torch import nn

from agents.settings import AgentSettings, Network, PPOSettings, SACSettings

CLASSES: Final[dict[str, type[BaseAlgorithm]]] = {"ppo": PPO, "sac": SAC}
ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": nn.Tanh, "elu": nn.ELU, "relu": nn.ReLU}


def make_model(agent: AgentSettings, env: VecEnv, seed: int) -> BaseAlgorithm:
    """A new model; `seed` is SB3's, of the network's first weights and of the exploration."""
    return _ppo(agent, env, seed) if isinstance(agent, PPOSettings) else _sac(agent, env, seed)


def _ppo(agent: PPOSettings, env: VecEnv, seed: int) -> PPO:
    return PPO(
        "MlpPolicy",
        env,
        n_steps=agent.rollout_steps,
        batch_size=agent.batch_size,
        n_epochs=agent.epochs,
        learning_rate=LinearSchedule(agent.learning_rate, agent.learning_rate_end, 1.0),
        gamma=agent.gamma,
        gae_lambda=agent.gae_lambda,
        clip_range=agent.clip_range,
        ent_coef=agent.entropy_coef,
        vf_coef=agent.value_coef,
        max_grad_norm=agent.max_grad_norm,
        policy_kwargs=_layers(agent.network) | {"log_std_init": agent.log_std_init},
        seed=seed,
        device="cpu",
    )


def _sac(agent: SACSettings, env: VecEnv, seed: int) -> SAC:
    return SAC(
        "MlpPolicy",
        env,
        train_freq=1,
        gradient_steps=agent.gradient_steps,
        batch_size=agent.batch_size,
        buffer_size=agent.buffer_size,
        learning_starts=agent.learning_starts,
        learning_rate=agent.learning_rate,
        gamma=agent.gamma,
        tau=agent.tau,
        ent_coef=f"auto_{agent.entropy_init}",
        target_entropy=agent.target_entropy,
        policy_kwargs=_layers(agent.network),
        seed=seed,
        device="cpu",
    )


def _layers(network: Network) -> dict[str, Any]:
    return {"net_arch": list(network.hidden), "activation_fn": ACTIVATIONS[network.activation]}
