"""Potential-based reward shaping: what training may see, and no report.

With F = gamma Phi(s') - Phi(s) added to the reward the best policy stays the best (Ng, Harada & Russell 1999), since
over an episode all that is added is -Phi of its start, whatever is flown. The potential is minus the weighted miss at
arrival if the follower only coasts, so that a burn is rewarded at once for the error that it takes away.
"""

import numpy as np
from numpy.typing import NDArray

from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario


class Shaping:
    """Adds the difference of the potential to the rewards of rows."""

    def __init__(self, scenario: Scenario, weight: float, gamma: float) -> None:
        """Set what stays.

        Args:
            scenario: what is flown.
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
        return -self._weight * np.sqrt(np.square(miss_m).sum(axis=-1))

    def restart(self, observations: NDArray[np.float32]) -> None:
        """Go on from observations (rows, SIZE)."""
        self._before = self.potential(observations)

    def added(
        self, observations: NDArray[np.float32], ended: NDArray[np.bool_], last: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """What a step adds to the rewards (rows,), m/s.

        Args:
            observations: after the step (rows, SIZE); of the next episode in rows that ended.
            ended: which rows did (rows,).
            last: potentials that the ended rows' episodes came to (ended,): 0 for an end that is one.
        """
        next_potentials = self.potential(observations)
        reached = next_potentials.copy()
        reached[ended] = last
        added: NDArray[np.float64] = self._gamma * reached - self._before
        self._before = next_potentials
        return added
