"""Critics that know where a thrust leads at once, and have to learn only what comes after.

To the critics of SAC a thrust is three more inputs, and what it is worth has to be told from returns that scatter a
thousand times as much. But what a thrust does within its step is known to whoever plans with the filter's model: it
costs |u| dt, and moves the estimate by Gamma u. So the value of thrust u in state s is

    Q(s, u) = -|u| dt + W(s'),    s' the observation that s and u are expected to lead to,

with W learnt: the value of an after-state (Sutton & Barto 2018, section 6.8).
"""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from stable_baselines3.sac.policies import SACPolicy
from torch import Tensor, nn

from agents.features import CUT
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE, Array
from formation_env.observation import LOG_RANGE, LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S, SIZE, SLICES
from formation_env.scenario import Scenario
from formation_env.schedule import FIELDS, OFFSETS, build_schedule, legs, observation_layout

ERROR = SLICES["error"]
REST = slice(SLICES["reference"].start, SIZE)
SMOOTH_THRUST = 1e-5
"""Thrusts below this, in units of the greatest, are not told from none; the root has no gradient there."""


class Foresight(nn.Module):
    """From observations and thrusts to the features of what they lead to; nothing in it is learnt.

    Legend: e error, r reference; Phi, Gamma, delta the filter's model; A, b the coast to the arrival.
    """

    def __init__(self, scenario: Scenario, magnification: float) -> None:
        """Prepare the scenario's steps.

        Args:
            scenario: what is flown.
            magnification: of the errors that come out, see `agents.features`.
        """
        super().__init__()
        layout = observation_layout(scenario)
        scale = layout.state_scale
        self._num_phases, self._steps_a_period = layout.num_phases, layout.period_s / scenario.dt_s
        self._magnification = float(__import__("os").environ.get("CM", magnification))
        unit = np.tile(np.repeat([LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S], 3), 2)
        self._keep("_ends", [leg.end for leg in legs(scenario)])
        self._keep("_maps", _maps(scenario) / np.tile(scale, 2)[:, None] * np.concatenate([scale, np.ones(4)]))
        self._keep("_log_scale", np.tile(scale, 2) / unit)

    def _keep(self, name: str, values: Any) -> None:
        self.register_buffer(name, torch.as_tensor(np.asarray(values), dtype=torch.float32), persistent=False)

    def forward(self, observations: Tensor, thrusts: Tensor) -> Tensor:
        """Features (rows, SIZE) expected a step after observations (rows, SIZE), under thrusts (rows, 3) in [-1, 1].

        Clock and filter's state are those before the step, which tell as much.
        """
        known = torch.cat([observations[:, ERROR], thrusts, torch.ones_like(thrusts[:, :1])], dim=1)
        both = torch.einsum("rij,rj->ri", self._maps[self._step(observations)], known)
        if __import__("os").environ.get("ASINH"):
            return torch.cat([torch.asinh(both * self._log_scale / float(__import__("os").environ["ASINH"])), torch.zeros_like(both), observations[:, REST]], dim=1)
        logs = both.sign() * torch.log1p(both.abs() * self._log_scale) / np.log1p(LOG_RANGE)
        return torch.cat([self._magnification * both, logs, observations[:, REST]], dim=1).clamp(-CUT, CUT)

    def _step(self, observations: Tensor) -> Tensor:
        """Which step of the plan begins (rows,)."""
        phase = (observations[:, SLICES["phase"].start] * self._num_phases).round().long()
        left = (observations[:, SLICES["time_left"].start] * self._steps_a_period).round()
        return (self._ends[phase] - left).long().clamp(0, len(self._maps) - 1)


def _maps(scenario: Scenario) -> Array:
    """For each step the matrix (T, 12, 10) from error, thrust and 1 to error and arrival error after it, SI units."""
    table, steps = build_schedule(scenario), scenario.num_steps
    model = scenario.filter_model().steps(0, steps)
    r, A = _columns(table, "reference"), np.zeros((steps + 1, 6, 6))
    for name, axes in (("coast_in_plane", IN_PLANE), ("coast_cross_track", CROSS_TRACK)):
        A[:, axes[:, None], axes] = _columns(table, name).reshape(-1, len(axes), len(axes))
    maps = np.zeros((steps, 12, 10))
    maps[:, :6, :6] = model.Phi
    maps[:, :6, 6:9] = scenario.spacecraft.max_accel_m_s2 * model.Gamma
    # x' - r' = Phi (e + r) + Gamma u + delta - r'
    maps[:, :6, 9] = np.einsum("kij,kj->ki", model.Phi, r[:-1]) + model.delta - r[1:]
    maps[:, 6:] = A[1:] @ maps[:, :6]
    maps[:, 6:, 9] += np.einsum("kij,kj->ki", A[1:], r[1:]) + _columns(table, "coast_offset")[1:]
    return maps


def _columns(table: Array, name: str) -> Array:
    return table[:, OFFSETS[name] : OFFSETS[name] + FIELDS[name]]


class AfterStateCritic(ContinuousCritic):
    """Critics -|u| dt + W(s')."""

    def __init__(
        self, foresight: Foresight, thrust_price: float, throttle_power: float, n_critics: int, hidden: list[int],
        activation: type[nn.Module], observation_space: Any, action_space: Any, features_extractor: BaseFeaturesExtractor,
    ) -> None:
        super().__init__(observation_space, action_space, [1], features_extractor, SIZE, n_critics=0, share_features_extractor=False)
        self.n_critics = n_critics
        self.foresight = foresight
        self._price, self._power = thrust_price, throttle_power
        for index in range(n_critics):
            network = nn.Sequential(*create_mlp(SIZE, 1, hidden, activation, post_linear_modules=[nn.LayerNorm] if __import__("os").environ.get("LN") else None))
            self.add_module(f"qf{index}", network)
            self.q_networks.append(network)

    def forward(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, ...]:
        thrusts = actions * actions.abs() ** (self._power - 1)
        size = torch.sqrt((thrusts**2).sum(dim=1, keepdim=True) + SMOOTH_THRUST**2)
        features = self.foresight(obs, thrusts)
        return tuple(network(features) - self._price * size for network in self.q_networks)


class AfterStatePolicy(SACPolicy):
    """SAC's actor with such critics."""

    def __init__(self, *args: Any, after: dict[str, Any], **kwargs: Any) -> None:
        self._after = after
        super().__init__(*args, **kwargs)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> ContinuousCritic:
        after = dict(self._after)
        foresight = Foresight(after.pop("scenario"), after.pop("magnification"))
        return AfterStateCritic(
            foresight, observation_space=self.observation_space, action_space=self.action_space,
            features_extractor=self.make_features_extractor(), **after,
        )
