"""Interface of the linear models of relative motion, and their exact discretisation.

Legend: A state matrix, B control matrix, d constant disturbance, Phi, Gamma, delta their discrete counterparts.
State: LVLH [x, y, z, x', y', z'], m and m/s; x radial (outward), y along-track, z along the orbit normal.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit

IN_PLANE = np.array([0, 1, 3, 4])
CROSS_TRACK = np.array([2, 5])


def control_matrix() -> Array:
    """B (6, 3): thrust acceleration enters the velocity rates (Ma 2009, eq. 4.3)."""
    return np.vstack([np.zeros((3, 3)), np.eye(3)])


@dataclass(frozen=True)
class DiscreteModel:
    """x(k+1) = Phi x(k) + Gamma u(k) + delta, exact for an input held over the step.

    Attributes:
        Phi: state transition matrix (..., 6, 6).
        Gamma: input matrix (..., 6, 3).
        delta: effect of the constant disturbance (..., 6).
    """

    Phi: Array
    Gamma: Array
    delta: Array

    def steps(self, start: int, end: int) -> "DiscreteModel":
        """The model of each step from start to end: (end - start, ...), be it the same for all steps or not."""
        if self.Phi.ndim == 3:
            return DiscreteModel(self.Phi[start:end], self.Gamma[start:end], self.delta[start:end])
        parts = (self.Phi, self.Gamma, self.delta)
        return DiscreteModel(*(np.broadcast_to(part, (end - start, *part.shape)) for part in parts))

    def from_start(self) -> "DiscreteModel":
        """The model from the start of the first of its steps (count, ...) to each instant (count + 1, ...)."""
        count = len(self.Phi)
        Phi, Gamma = np.tile(np.eye(6), (count + 1, 1, 1)), np.zeros((count + 1, 6, 3))
        delta = np.zeros((count + 1, 6))
        for k in range(count):
            Phi[k + 1] = self.Phi[k] @ Phi[k]
            Gamma[k + 1] = self.Phi[k] @ Gamma[k] + self.Gamma[k]
            delta[k + 1] = self.Phi[k] @ delta[k] + self.delta[k]
        return DiscreteModel(Phi, Gamma, delta)


class Dynamics(ABC):
    """A linear model x' = A(t) x + B u + d, whose orbit plane and cross-track motions are uncoupled.

    Attributes:
        time_invariant: whether A is constant.
    """

    time_invariant: bool = True

    @abstractmethod
    def state_matrix(self, orbit: Orbit, spacecraft: Spacecraft, times_s: ArrayLike = 0.0) -> Array:
        """A (6, 6), or (..., 6, 6) at times (...), s, if it varies."""

    @abstractmethod
    def disturbance(self, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> Array:
        """d (6,): the constant relative acceleration in its last three elements, m/s^2."""

    def discretise(
        self, start_s: ArrayLike, step_s: ArrayLike, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft
    ) -> DiscreteModel:
        """Exact zero-order-hold discretisation (Ma 2009, eq. 4.6-4.7), by one matrix exponential (Van Loan 1978).

        Args:
            start_s: times (...) at which the steps begin, s; they matter to a model that varies only.
            step_s: one step or an array (...) of steps, s.
            orbit: the leader's orbit.
            spacecraft: the follower.
            leader: the leader.
        """
        augmented = np.zeros((10, 10))
        augmented[:6, :6] = self.state_matrix(orbit, spacecraft)
        augmented[:6, 6:9] = control_matrix()
        augmented[:6, 9] = self.disturbance(orbit, spacecraft, leader)
        # exp([A B d; 0 0 0] T) = [Phi Gamma delta; 0 I]
        exponential = expm(augmented * np.asarray(step_s, float)[..., None, None])
        return DiscreteModel(exponential[..., :6, :6], exponential[..., :6, 6:9], exponential[..., :6, 9])
