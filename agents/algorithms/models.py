"""From hyperparameters to Stable-Baselines3's environments and models."""

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from agents.algorithms.shaping import Shaping
from agents.algorithms.throttle_policy import ThrottleOutput
from agents.algorithms.vec_env import Sb3VecEnv
from agents.hyperparameters import CommonSettings
from formation_env.task.scenario import Scenario


def make_env(settings: CommonSettings, scenario: Scenario) -> VecEnv:
    """Make the batched environment that the hyperparameters describe."""
    shaping = Shaping(scenario, settings.shaping_weight, settings.gamma) if settings.shaping_weight else None
    env = Sb3VecEnv(
        settings.rows,
        scenario,
        reward_scale=settings.reward_scale,
        throttle_power=settings.throttle_power,
        shaping=shaping,
        bootstrap_end=settings.bootstrap_end,
        stagger=settings.stagger_starts,
    )
    return VecNormalize(env, norm_obs=False, gamma=settings.gamma) if settings.normalise_reward else env


def make_model(settings: CommonSettings, env: VecEnv, seed: int) -> BaseAlgorithm:
    """Build a new model for training on `env`, the environment of `make_env`.

    Args:
        settings: the hyperparameters.
        env: turns throttles into thrusts itself, so the policy's `predict` gives throttles in this model.
        seed: of SB3, for initial weights and exploration.
    """
    model = settings.make_model(env, seed)
    if isinstance(model.policy, ThrottleOutput):
        model.policy.predicts_throttles = True
    return model
