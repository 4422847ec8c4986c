"""The gradient of an episode's cost through the model, all the way back to a network's weights.

With the disturbances of `recording`, state, observation and cost of a whole episode are smooth functions of the
network's weights, and backpropagation through time gives the cost's gradient. It points the same way as the policy
gradient of reinforcement learning, but has no noise of exploration in it.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from agents.features import CUT
from agents.pretraining.recording import Recording
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE, Array
from formation_env.observation import LOG_RANGE, LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S
from formation_env.schedule import FIELDS, OFFSETS, build_schedule, observation_layout

SMOOTH_M: Final = 1e-2
"""Errors below this are not told from zero; the root has no gradient there."""
SMOOTH_THROTTLE: Final = 1e-5
"""The same for thrusts, in units of the greatest."""


@dataclass(frozen=True)
class Output:
    """From a network's output to the thrust.

    Attributes:
        squash: `clip` or `tanh`, to [-1, 1].
        throttle_power: p of the thrust sign(z) |z|^p.
    """

    squash: str
    throttle_power: float

    def throttle(self, out: Tensor) -> Tensor:
        """Throttles z (..., 3) in [-1, 1] for outputs (..., 3)."""
        return out.tanh() if self.squash == "tanh" else out.clamp(-1, 1)

    def of_throttle(self, z: Tensor) -> Tensor:
        """Actions (..., 3) for throttles."""
        return z * z.abs() ** (self.throttle_power - 1)

    def thrust(self, out: Tensor) -> Tensor:
        """Actions (..., 3) for outputs (..., 3)."""
        return self.of_throttle(self.throttle(out))


class ModelEpisodes:
    """Recorded episodes that a network can be flown through, and differentiated.

    Legend: x true state, x_hat estimate, r reference; Phi, Gamma, delta the true model; A, b the coast to the arrival.
    """

    def __init__(self, recording: Recording, magnification: float) -> None:
        scenario = recording.scenario
        self.rows, self.steps = recording.starts.shape[0], scenario.num_steps
        self._magnification = magnification
        self._scenario = scenario
        table, model = build_schedule(scenario), scenario.true_model()
        self._Phi, self._Gamma, self._delta = (
            _tensor(np.broadcast_to(part, (self.steps, *part.shape[-rank:])))
            for part, rank in ((model.Phi, 2), (model.Gamma, 2), (model.delta, 1))
        )
        self._A, self._b = _tensor(_coasts(table)), _tensor(_columns(table, "coast_offset"))
        self._r, self._scored = _tensor(_columns(table, "reference")), _tensor(_columns(table, "scored_position"))
        self._price = table[:, OFFSETS["error_price"]].tolist()
        self._scale = _tensor(observation_layout(scenario).state_scale)
        self._log_unit = _tensor(np.repeat([LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S], 3))
        self._starts, self._pushes = _tensor(recording.starts), _tensor(recording.pushes)
        self._errors, self._rest = _tensor(recording.estimate_errors), _tensor(recording.rest)

    def cost(self, network: nn.Module, output: Output, rows: Any) -> Tensor:
        """Mean cost of some rows' episodes, m/s: minus the environment's return.

        Args:
            network: from features (rows, SIZE) to outputs (rows, 3).
            output: what the outputs stand for.
            rows: which, any index of tensors.
        """
        spacecraft, dt_s = self._scenario.spacecraft, self._scenario.dt_s
        x, pushes, errors, rest = self._starts[rows], self._pushes[:, rows], self._errors[:, rows], self._rest[:, rows]
        thrusts, error_cost = [], torch.zeros(())
        for step in range(self.steps):
            action = output.thrust(network(self._features(step, x + errors[step], rest[step])))
            push = (spacecraft.max_accel_m_s2 * action) @ self._Gamma[step].T
            x = x @ self._Phi[step].T + push + self._delta[step] + pushes[step]
            thrusts.append(action)
            if self._price[step + 1]:
                error_cost = error_cost + self._price[step + 1] * self._judged(x[:, :3] - self._scored[step + 1])
        delta_v = _norm(torch.stack(thrusts), SMOOTH_THROTTLE).mean(dim=1).sum() * spacecraft.max_accel_m_s2 * dt_s
        return delta_v + error_cost

    def _judged(self, error: Tensor) -> Tensor:
        """Mean over the rows of what the reward counts of position errors (rows, 3), m."""
        reward = self._scenario.reward
        if reward.shape == "quadratic":
            return (error**2).sum(dim=-1).mean() / reward.quadratic_scale_m
        return _norm(error, SMOOTH_M).mean()

    def _features(self, step: int, x_hat: Tensor, rest: Tensor) -> Tensor:
        """What the network reads (rows, SIZE), as the environment and `agents.features` make it."""
        error, arrival = x_hat - self._r[step], x_hat @ self._A[step].T + self._b[step]
        both = torch.cat([error, arrival], dim=-1)
        linear = self._magnification * both / self._scale.repeat(2)
        logs = both.sign() * torch.log1p(both.abs() / self._log_unit.repeat(2)) / np.log1p(LOG_RANGE)
        return torch.cat([linear, logs, rest], dim=-1).clamp(-CUT, CUT)


def _norm(vectors: Tensor, smooth: float) -> Tensor:
    """|v| of (..., n), with a gradient at zero, too."""
    return torch.sqrt((vectors**2).sum(dim=-1) + smooth**2) - smooth


def _coasts(table: Array) -> Array:
    """Transition matrices (T + 1, 6, 6) to the arrival out of the plan's table."""
    A = np.zeros((len(table), 6, 6))
    for name, axes in (("coast_in_plane", IN_PLANE), ("coast_cross_track", CROSS_TRACK)):
        A[:, axes[:, None], axes] = _columns(table, name).reshape(-1, len(axes), len(axes))
    return A


def _columns(table: Array, name: str) -> Array:
    return table[:, OFFSETS[name] : OFFSETS[name] + FIELDS[name]]


def _tensor(array: Any) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(array, dtype=np.float32))
