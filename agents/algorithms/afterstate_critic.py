"""Critics of after-states: the immediate effect of a thrust is modelled, and only its consequences are learnt.

SAC's own critics read a thrust as three more inputs and have to infer its value from returns that scatter a thousand
times as much. Within its step, however, the effect of a thrust follows from the filter's model: it costs |u| dt and
moves the estimate by Gamma u. So the value of thrust u in state s is

    Q(s, u) = -|u| dt + W(s'),    s' the state predicted from s and u,

with W learnt: the value of an after-state (Sutton & Barto 2018, section 6.8).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from torch import Tensor, nn

from agents.algorithms.throttle_policy import ThrottleSACPolicy
from agents.policy.features import REST
from agents.policy.throttle import thrust_of
from formation_env.numerics.arrays import Array
from formation_env.task.observation import SIZE, SLICES, observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, coast_matrices, columns, legs

ERROR: Final = SLICES["error"]
NUM_FEATURES: Final = 12 + REST.stop - REST.start
"""Number of features that `AfterStateFeatures` gives."""
UNIT_POS_M: Final = 20.0
UNIT_VEL_M_S: Final = 0.02
"""Errors below these enter a critic linearly, larger ones compressed by asinh. Smaller units, or the observation's
logarithms, are so steep near zero that critics fit noise."""
SMOOTH_THRUST: Final = 1e-5
"""Smoothing of |u| near zero, where the root has no gradient, in units of the maximum thrust."""


class AfterStateFeatures(nn.Module):
    """Map observations and thrusts to features of the predicted next state; it has no parameters.

    Legend: e error, r reference; Phi, Gamma, delta the filter's model; A, b the coast to the arrival.
    """

    if TYPE_CHECKING:
        ends: Tensor
        maps: Tensor

    def __init__(self, scenario: Scenario) -> None:
        """Tabulate the prediction of each of the scenario's steps."""
        super().__init__()
        layout = observation_layout(scenario)
        self._num_phases, self._steps_per_period = layout.num_phases, layout.period_s / scenario.dt_s
        known = np.concatenate([layout.state_scale, np.ones(4)])
        units = np.tile(np.repeat([UNIT_POS_M, UNIT_VEL_M_S], 3), 2)
        for name, values in (
            ("ends", np.array([leg.end for leg in legs(scenario)])),
            ("maps", _maps(scenario) * known / units[:, None]),
        ):
            self.register_buffer(name, torch.as_tensor(values, dtype=torch.float32), persistent=False)

    def errors(self, observations: Tensor, thrusts: Tensor) -> Tensor:
        """Error and zero-effort miss (rows, 12) predicted a step later, in units of UNIT_POS_M and UNIT_VEL_M_S.

        Args:
            observations: (rows, SIZE).
            thrusts: (rows, 3), in units of the maximum.
        """
        known = torch.cat([observations[:, ERROR], thrusts, torch.ones_like(thrusts[:, :1])], dim=1)
        return torch.einsum("rij,rj->ri", self.maps[self._steps(observations)], known)

    def forward(self, observations: Tensor, thrusts: Tensor) -> Tensor:
        """Features (rows, NUM_FEATURES). Plan, clock and filter are those before the step, which carry as much."""
        return torch.cat([torch.asinh(self.errors(observations, thrusts)), observations[:, REST]], dim=1)

    def _steps(self, observations: Tensor) -> Tensor:
        """Index (rows,) of the step that begins."""
        phase = (observations[:, SLICES["phase"].start] * self._num_phases).round().long()
        left = (observations[:, SLICES["time_left"].start] * self._steps_per_period).round()
        return (self.ends[phase] - left).long().clamp(0, len(self.maps) - 1)


def _maps(scenario: Scenario) -> Array:
    """Matrices (T, 12, 10) of each step from error, thrust and 1 to error and zero-effort miss after it; m, m/s."""
    table, model = build_schedule(scenario), scenario.filter_dynamics().steps(0, scenario.num_steps)
    r, A = columns(table, "reference"), coast_matrices(table)
    maps = np.zeros((scenario.num_steps, 12, 10))
    # x' - r' = Phi e + Gamma u + (Phi r + delta - r')
    maps[:, :6, :6] = model.Phi
    maps[:, :6, 6:9] = scenario.spacecraft.max_accel_m_s2 * model.Gamma
    maps[:, :6, 9] = np.einsum("kij,kj->ki", model.Phi, r[:-1]) + model.delta - r[1:]
    # A' x' + b' = A' (x' - r') + (A' r' + b')
    maps[:, 6:] = A[1:] @ maps[:, :6]
    maps[:, 6:, 9] += np.einsum("kij,kj->ki", A[1:], r[1:]) + columns(table, "coast_offset")[1:]
    return maps


@dataclass(frozen=True)
class ThrustCost:
    """Model of a thrust's immediate cost and effect.

    Attributes:
        scenario: task that is flown.
        throttle_power: p of the thrust sign(z) |z|^p for an action z.
        full_thrust_cost: scaled reward that one step of the maximum thrust costs.
    """

    scenario: Scenario
    throttle_power: float
    full_thrust_cost: float


class AfterStateCritic(ContinuousCritic):
    """Critics Q(s, u) = -|u| dt + W(s')."""

    def __init__(
        self,
        thrust_cost: ThrustCost,
        observation_space: spaces.Space[Any],
        action_space: spaces.Box,
        net_arch: list[int],
        features_extractor: BaseFeaturesExtractor,
        activation_fn: type[nn.Module],
        n_critics: int,
    ) -> None:
        super().__init__(observation_space, action_space, net_arch, features_extractor, SIZE, n_critics=0)
        self.n_critics, self._thrust_cost = n_critics, thrust_cost
        self._after_state = AfterStateFeatures(thrust_cost.scenario)
        for index in range(n_critics):
            network = nn.Sequential(*create_mlp(NUM_FEATURES, 1, net_arch, activation_fn))
            self.add_module(f"qf{index}", network)
            self.q_networks.append(network)

    def forward(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, ...]:
        """Each network's values (rows, 1) of actions (rows, 3) at observations (rows, SIZE)."""
        thrusts = thrust_of(actions, self._thrust_cost.throttle_power)
        size = torch.sqrt((thrusts**2).sum(dim=1, keepdim=True) + SMOOTH_THRUST**2)
        cost = self._thrust_cost.full_thrust_cost * size
        features = self._after_state(obs, thrusts)
        return tuple(network(features) - cost for network in self.q_networks)


class AfterStatePolicy(ThrottleSACPolicy):
    """SAC's actor with critics of after-states."""

    def __init__(self, *args: Any, thrust_cost: ThrustCost, **kwargs: Any) -> None:  # SACPolicy's arguments
        self._thrust_cost = thrust_cost
        super().__init__(*args, **kwargs)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> AfterStateCritic:
        """Build the critics."""
        given = self._update_features_extractor(self.critic_kwargs, features_extractor)
        names = ("observation_space", "action_space", "net_arch", "features_extractor", "activation_fn", "n_critics")
        return AfterStateCritic(self._thrust_cost, **{name: given[name] for name in names})
