"""Critics that know where a thrust leads at once, and have to learn only what comes after.

To SAC's own critics a thrust is three more inputs, and what it is worth has to be told from returns that scatter a
thousand times as much. But what a thrust does within its step is known to whoever plans with the filter's model: it
costs |u| dt, and moves the estimate by Gamma u. So the value of thrust u in state s is

    Q(s, u) = -|u| dt + W(s'),    s' where s and u are expected to lead,

with W learnt: the value of an after-state (Sutton & Barto 2018, section 6.8).
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from stable_baselines3.sac.policies import SACPolicy
from torch import Tensor, nn

from agents.policy.features import REST
from agents.policy.throttle import thrust_of
from formation_env.numerics.arrays import Array
from formation_env.task.observation import SIZE, SLICES, observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, coast_matrices, columns, legs

ERROR: Final = SLICES["error"]
SHOWN: Final = 12 + REST.stop - REST.start
"""How many features `Foresight` gives."""
UNIT_POS_M: Final = 20.0
UNIT_VEL_M_S: Final = 0.02
"""Errors below these are shown to a critic as they are, larger ones compressed. Smaller units, or the observation's
logarithms, are so steep near zero that critics fit noise."""
SMOOTH_THRUST: Final = 1e-5
"""Thrusts below this, in units of the greatest, are not told from none; the root has no gradient there."""


class Foresight(nn.Module):
    """From observations and thrusts to features of where they are expected to lead; nothing in it is learnt.

    Legend: e error, r reference; Phi, Gamma, delta the filter's model; A, b the coast to the arrival.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Prepare all steps of a scenario."""
        super().__init__()
        layout = observation_layout(scenario)
        self._num_phases, self._steps_a_period = layout.num_phases, layout.period_s / scenario.dt_s
        known = np.concatenate([layout.state_scale, np.ones(4)])
        units = np.tile(np.repeat([UNIT_POS_M, UNIT_VEL_M_S], 3), 2)
        for name, values in (
            ("ends", np.array([leg.end for leg in legs(scenario)])),
            ("maps", _maps(scenario) * known / units[:, None]),
        ):
            self.register_buffer(name, torch.as_tensor(values, dtype=torch.float32), persistent=False)

    def errors(self, observations: Tensor, thrusts: Tensor) -> Tensor:
        """Error and arrival error (rows, 12) expected a step later, in units of UNIT_POS_M and UNIT_VEL_M_S.

        Args:
            observations: (rows, SIZE).
            thrusts: (rows, 3), in units of the greatest.
        """
        known = torch.cat([observations[:, ERROR], thrusts, torch.ones_like(thrusts[:, :1])], dim=1)
        return torch.einsum("rij,rj->ri", self.maps[self._steps(observations)], known)

    def forward(self, observations: Tensor, thrusts: Tensor) -> Tensor:
        """Features (rows, SHOWN). Plan, clock and filter are shown as before the step, which tells as much."""
        return torch.cat([torch.asinh(self.errors(observations, thrusts)), observations[:, REST]], dim=1)

    def _steps(self, observations: Tensor) -> Tensor:
        """Which step of the plan begins (rows,)."""
        phase = (observations[:, SLICES["phase"].start] * self._num_phases).round().long()
        left = (observations[:, SLICES["time_left"].start] * self._steps_a_period).round()
        return (self.ends[phase] - left).long().clamp(0, len(self.maps) - 1)


def _maps(scenario: Scenario) -> Array:
    """For each step the matrix (T, 12, 10) from error, thrust and 1 to error and arrival error after it; m, m/s."""
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
class Known:
    """What is known of a thrust.

    Attributes:
        scenario: what is flown.
        throttle_power: p of the thrust sign(z) |z|^p that an action z stands for.
        thrust_price: reward that the greatest thrust costs in a step.
    """

    scenario: Scenario
    throttle_power: float
    thrust_price: float


class AfterStateCritic(ContinuousCritic):
    """Two critics of that kind."""

    def __init__(
        self,
        known: Known,
        observation_space: spaces.Space,
        action_space: spaces.Box,
        net_arch: list[int],
        features_extractor: BaseFeaturesExtractor,
        activation_fn: type[nn.Module],
        n_critics: int,
    ) -> None:
        super().__init__(observation_space, action_space, net_arch, features_extractor, SIZE, n_critics=0)
        self.n_critics, self._known, self._foresight = n_critics, known, Foresight(known.scenario)
        for index in range(n_critics):
            network = nn.Sequential(*create_mlp(SHOWN, 1, net_arch, activation_fn))
            self.add_module(f"qf{index}", network)
            self.q_networks.append(network)

    def forward(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, ...]:
        """Each network's values (rows, 1) of actions (rows, 3) at observations (rows, SIZE)."""
        thrusts = thrust_of(actions, self._known.throttle_power)
        price = self._known.thrust_price * torch.sqrt((thrusts**2).sum(dim=1, keepdim=True) + SMOOTH_THRUST**2)
        features = self._foresight(obs, thrusts)
        return tuple(network(features) - price for network in self.q_networks)


class AfterStatePolicy(SACPolicy):
    """SAC's actor with such critics."""

    def __init__(self, *args: Any, known: Known, **kwargs: Any) -> None:  # SACPolicy's arguments
        self._known = known
        super().__init__(*args, **kwargs)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> AfterStateCritic:
        """New critics."""
        given = self._update_features_extractor(self.critic_kwargs, features_extractor)
        names = ("observation_space", "action_space", "net_arch", "features_extractor", "activation_fn", "n_critics")
        return AfterStateCritic(self._known, **{name: given[name] for name in names})
