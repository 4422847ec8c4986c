"""Gradient of an episode's cost with respect to a network's weights, by backpropagation through the model.

With the disturbances of `recording`, state, observation and cost of a whole episode are smooth functions of the
network's weights. The gradient estimates the same quantity as the policy gradient of reinforcement learning, without
the noise of exploration.
"""

import math
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from agents.policy.features import CUT
from agents.policy.throttle import thrust_of
from agents.pretraining.recording import Recording
from formation_env.task.observation import LOG_RANGE, LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S, observation_layout
from formation_env.task.schedule import build_schedule, coast_matrices, column, columns

SMOOTH_M: Final = 1e-2
"""Smoothing of the position error's norm near zero, where the root has no gradient, m."""
SMOOTH_THROTTLE: Final = 1e-5
"""Smoothing of the thrust's norm near zero, in units of the maximum thrust."""


class ModelEpisodes:
    """Recorded episodes as a differentiable simulation of a network's flight.

    Legend: x true state, x_hat estimate, r reference; Phi, Gamma, delta the true model; A, b the coast to the arrival.
    """

    def __init__(self, recording: Recording, magnification: float) -> None:
        scenario = recording.scenario
        self.rows, self.steps = recording.starts.shape[0], scenario.num_steps
        self._scenario = scenario
        table, model = build_schedule(scenario), scenario.true_dynamics()
        Phi, Gamma, delta = (
            np.broadcast_to(part, (self.steps, *part.shape[-rank:]))
            for part, rank in ((model.Phi, 2), (model.Gamma, 2), (model.delta, 1))
        )
        # x' = [Phi, Gamma u_max] [x; action] + push, for rows of states
        self._motion = _tensor(np.concatenate([Phi, scenario.spacecraft.max_accel_m_s2 * Gamma], axis=2).swapaxes(1, 2))
        self._pushes = _tensor(recording.pushes + delta[:, None])
        # both errors, (x_hat - r, A x_hat + b), in units of the logarithms
        unit = np.tile(np.repeat([LOG_UNIT_POS_M, LOG_UNIT_VEL_M_S], 3), 2)
        A, b, r = coast_matrices(table), columns(table, "coast_offset"), columns(table, "reference")
        matrices = np.concatenate([np.broadcast_to(np.eye(6), A.shape), A], axis=1) / unit[:, None]
        self._both, self._offset = _tensor(matrices.swapaxes(1, 2)), _tensor(np.concatenate([-r, b], axis=1) / unit)
        self._linear = _tensor(magnification * unit / np.tile(observation_layout(scenario).state_scale, 2))
        self._error_weight, self._scored_position = (
            _tensor(column(table, "error_weight")),
            _tensor(columns(table, "scored_position")),
        )
        self._starts, self._errors = _tensor(recording.starts), _tensor(recording.estimate_errors)
        self._rest = _tensor(recording.rest)

    def cost(self, network: nn.Module, throttle_power: float, rows: Any) -> Tensor:
        """Mean cost of the episodes of some rows, m/s: minus the environment's return.

        Args:
            network: from features (rows, SIZE) to throttles before the tanh (rows, 3).
            throttle_power: p of the thrust sign(z) |z|^p for a throttle z.
            rows: which episodes, any index of tensors.
        """
        x, pushes, errors, rest = self._starts[rows], self._pushes[:, rows], self._errors[:, rows], self._rest[:, rows]
        actions, positions = list[Tensor](), list[Tensor]()
        for step in range(self.steps):
            z = network(self._features(step, x + errors[step], rest[step])).tanh()
            action = thrust_of(z, throttle_power)
            x = torch.addmm(pushes[step], torch.cat([x, action], dim=1), self._motion[step])
            actions.append(action)
            positions.append(x[:, :3])
        impulse = self._scenario.spacecraft.max_accel_m_s2 * self._scenario.dt_s
        misses = torch.stack(positions) - self._scored_position[1:, None]
        return impulse * _norm(torch.stack(actions), SMOOTH_THROTTLE).mean(dim=1).sum() + (
            self._error_weight[1:] @ self._error_cost(misses).mean(dim=1)
        )

    def _error_cost(self, misses: Tensor) -> Tensor:
        """Cost (...) of position errors (..., 3), m, per unit of their weight, smooth at zero."""
        cost = self._scenario.reward.cost()
        total = cost.linear * _norm(misses, SMOOTH_M) if cost.linear else torch.zeros(misses.shape[:-1])
        return total + cost.quadratic * (misses**2).sum(dim=-1) if cost.quadratic else total

    def _features(self, step: int, x_hat: Tensor, rest: Tensor) -> Tensor:
        """Network input (rows, SIZE), as the environment and `agents.policy.features` form it."""
        both = torch.addmm(self._offset[step], x_hat, self._both[step])
        logs = both.sign() * torch.log1p(both.abs()) / math.log1p(LOG_RANGE)
        return torch.cat([both * self._linear, logs, rest], dim=1).clamp(-CUT, CUT)


def _norm(vectors: Tensor, smooth: float) -> Tensor:
    """Smoothed norm of vectors (..., n), differentiable at zero."""
    return torch.sqrt((vectors**2).sum(dim=-1) + smooth**2) - smooth


def _tensor(array: Any) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(array, dtype=np.float32))
