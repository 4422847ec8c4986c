"""Stable-Baselines3's policies for these environments: input, squashing, and the throttle in what `predict` returns.

In training a policy's actions are throttles, which `Sb3VecEnv` turns into thrusts. A model that is loaded from its file
by plain `PPO.load` or `SAC.load` meets no such adapter, so its `predict` gives the environment's actions themselves.
"""

from typing import TYPE_CHECKING, Any, Final

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import Schedule
from stable_baselines3.sac.policies import SACPolicy
from torch import nn

from agents.hyperparameters import CommonSettings
from agents.policy.features import CUT, MAGNIFIED
from agents.policy.throttle import throttle
from formation_env.task.observation import SIZE

ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": nn.Tanh, "elu": nn.ELU, "relu": nn.ReLU}


class Magnifier(BaseFeaturesExtractor):
    """Features of `agents.policy.features` as a torch module without parameters."""

    if TYPE_CHECKING:
        factors: torch.Tensor

    def __init__(self, observation_space: spaces.Box, magnification: float) -> None:
        super().__init__(observation_space, SIZE)
        factors = torch.ones(SIZE)
        factors[MAGNIFIED] = magnification
        self.register_buffer("factors", factors, persistent=False)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features (rows, SIZE) of observations (rows, SIZE)."""
        return (observations * self.factors).clamp(-CUT, CUT)


class ThrottleOutput(BasePolicy):
    """A mixin for SB3's policies: `predict` returns thrusts, except while `make_model`'s environment applies them.

    Attributes:
        predicts_throttles: True in training, where the environment's adapter turns throttles into thrusts.
        throttle_power: p of the thrust sign(z) |z|^p for a throttle z.
    """

    predicts_throttles: bool = False

    def __init__(self, *args: Any, throttle_power: float, **kwargs: Any) -> None:  # arguments of SB3's policies
        self.throttle_power = throttle_power
        super().__init__(*args, **kwargs)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Actions (3,) or (rows, 3) for one observation or a batch: thrusts in units of the maximum, and `state`."""
        z, state = super().predict(observation, state, episode_start, deterministic)
        return (z if self.predicts_throttles else throttle(z, self.throttle_power)), state


class SquashedPolicy(ThrottleOutput, ActorCriticPolicy):
    """SB3's "MlpPolicy" for PPO with a tanh on the mean, as SAC has it: one pretrained actor serves both."""

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self.action_net.register_forward_hook(lambda layer, inputs, mean: mean.tanh())


class ThrottleSACPolicy(ThrottleOutput, SACPolicy):
    """SB3's "MlpPolicy" for SAC."""


def policy_arguments(settings: CommonSettings) -> dict[str, Any]:
    """Keyword arguments of the policies' constructors."""
    return {
        "throttle_power": settings.throttle_power,
        "net_arch": list(settings.network.hidden),
        "activation_fn": ACTIVATIONS[settings.network.activation],
        "features_extractor_class": Magnifier,
        "features_extractor_kwargs": {"magnification": settings.magnification},
        "log_std_init": settings.log_std_init,
    }
