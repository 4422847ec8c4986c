"""Reward of a step: the weight of a position error, its cost, and the phase that scores it, stated once for all users.

The reward of a step is minus its delta-v and minus the weighted cost of the position error at the step's end. The error
is scored by the phase that the step belongs to, so the first instant of a phase is scored by the phase before.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.quantities import ErrorScale, ErrorWeight
from formation_env.settings import settings


@dataclass(frozen=True)
class ErrorCost:
    """Cost of a position error e per unit of its weight: linear |e| + quadratic |e|^2, in m.

    Attributes:
        linear: coefficient of |e|, 1.
        quadratic: coefficient of |e|^2, 1/m.
    """

    linear: float
    quadratic: float

    def of(self, error_m: Array) -> Array:
        """Cost (...) of error magnitudes (...), m."""
        return self.linear * error_m + self.quadratic * error_m**2

    def per_square(self, error_m: Array, floor_m: float) -> Array:
        """Coefficient (...) of |e|^2 that costs the same at error magnitudes (...), 1/m.

        Args:
            error_m: magnitudes, m.
            floor_m: added to the magnitudes in the linear part, so that the coefficient stays finite, m.
        """
        if self.linear == 0:
            return np.full(error_m.shape, self.quadratic)
        return self.linear / (error_m + floor_m) + self.quadratic


@settings(renamed={"shape": "error_cost"})
class Reward:
    """r = -(delta-v + error_weight |e| dt / T_hold), an equivalent delta-v in m/s.

    Attributes:
        error_weight: weight of the mean position error of the hold, (m/s) per m.
        transfer_error_weight: weight of errors during transfer, also times dt / T_hold; 0 leaves the path free.
        error_cost: `linear` in the error, or `quadratic`: |e|^2 / quadratic_scale_m in place of |e|.
        quadratic_scale_m: error at which both forms cost the same, m.
    """

    error_weight: ErrorWeight = 0.01
    transfer_error_weight: ErrorWeight = 0.0
    error_cost: Literal["linear", "quadratic"] = "linear"
    quadratic_scale_m: ErrorScale = 100.0

    def cost(self) -> ErrorCost:
        """Cost of an error per unit of its weight."""
        if self.error_cost == "linear":
            return ErrorCost(linear=1.0, quadratic=0.0)
        return ErrorCost(linear=0.0, quadratic=1 / self.quadratic_scale_m)

    def mean_error_weight(self) -> float | None:
        """Weight w if an episode costs delta-v + w (mean error of the hold), (m/s) per m; None for any other cost."""
        linear = self.error_cost == "linear" and self.transfer_error_weight == 0
        return self.error_weight if linear else None


@dataclass(frozen=True)
class Scoring:
    """Scoring of the position error at each instant (num_steps + 1,), by the step that ends there.

    Attributes:
        leg: index of the phase that the step belongs to; no step ends at instant 0, whose error is reported by phase 0.
        in_hold: whether the step belongs to a hold.
        error_weight: weight of the error, (m/s) per m; 0 at instant 0.
    """

    leg: NDArray[np.intp]
    in_hold: NDArray[np.bool_]
    error_weight: Array


def scoring(reward: Reward, arrivals: Sequence[int], ends: Sequence[int], dt_s: float) -> Scoring:
    """Score the errors of an episode.

    Args:
        reward: weights.
        arrivals: step at which the transfer of each phase ends.
        ends: step at which each phase ends.
        dt_s: time step, s.
    """
    instants = np.arange(ends[-1] + 1)
    leg = np.searchsorted(ends, instants)  # a phase's first instant is the end of the phase before
    in_hold = instants > np.asarray(arrivals)[leg]
    hold_s = dt_s * int(in_hold.sum())
    # every step counts dt / T_hold, so the weights of the hold add up to error_weight
    weight = np.where(in_hold, reward.error_weight, reward.transfer_error_weight) * dt_s / hold_s
    weight[0] = 0.0
    return Scoring(leg, in_hold, weight)
