"""Potential-based reward shaping, for training only; reports never contain it.

Adding F = gamma Phi(s') - Phi(s) to the reward preserves the optimal policy (Ng, Harada & Russell 1999), since the sum
over an episode is -Phi of its start whatever is flown. The potential is minus the weighted zero-effort miss at arrival,
so that a burn is rewarded at once for the error that it removes.
"""

import numpy as np
from numpy.typing import NDArray

from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario


class Shaping:
    """Shaping term of the rows of a batched environment."""

    def __init__(self, scenario: Scenario, weight: float, gamma: float) -> None:
        """Fix the potential.

        Args:
            scenario: task that is flown.
            weight: of the potential, (m/s) per m.
            gamma: the learner's discount per step.
        """
        self._layout = observation_layout(scenario)
        self._weight = weight
        self._gamma = gamma
        self._before: NDArray[np.float64] = np.zeros(0)

    def potential(self, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """Minus the weighted miss at arrival (...), m/s, of observations (..., SIZE)."""
        miss_m = self._layout.state(observations, "zero_effort_miss")[..., :3]
        potential: NDArray[np.float64] = -self._weight * np.sqrt(np.square(miss_m).sum(axis=-1))
        return potential

    def restart(self, observations: NDArray[np.float32]) -> None:
        """Set the potential before the next step from observations (rows, SIZE)."""
        self._before = self.potential(observations)

    def added(
        self, observations: NDArray[np.float32], ended: NDArray[np.bool_], last: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Shaping term of a step (rows,), m/s.

        Args:
            observations: after the step (rows, SIZE); of the next episode in rows that ended.
            ended: whether a row's episode ended (rows,).
            last: final potentials of the rows that ended (ended,): 0 after a termination.
        """
        next_potentials = self.potential(observations)
        reached = next_potentials.copy()
        reached[ended] = last
        added: NDArray[np.float64] = self._gamma * reached - self._before
        self._before = next_potentials
        return added
