"""What all policies of this package are: a law from the observation to an acceleration."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from formation_env.numerics.arrays import Actions, Array, Observations
from formation_env.task.scenario import Scenario


class AccelerationPolicy(ABC):
    """A policy without memory, with Stable-Baselines3's `predict`.

    Attributes:
        scenario: what it is made for.
        Settings: class of its gains.
    """

    Settings: type[Any]

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._max_accel_m_s2 = scenario.spacecraft.max_accel_m_s2

    @abstractmethod
    def acceleration(self, observation: Observations) -> Array:
        """Wanted accelerations (..., 3), m/s^2, for observations (..., SIZE)."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """Actions for one observation or for a batch, as Stable-Baselines3's policies give them.

        Args:
            observation: (SIZE,) or (rows, SIZE).
            state: handed back as it is.
            episode_start: not needed.
            deterministic: makes no difference.

        Returns:
            Actions (3,) or (rows, 3), float32, in units of max_accel_m_s2 and cut to [-1, 1]; and `state`.
        """
        accelerations = self.acceleration(np.asarray(observation, np.float32))
        return np.clip(accelerations / self._max_accel_m_s2, -1.0, 1.0).astype(np.float32), state

    def within_limit(self, accelerations: Array) -> Array:
        """Accelerations (..., 3), m/s^2, shortened so that no axis is beyond the limit; their directions stay."""
        excess = np.abs(accelerations).max(axis=-1, keepdims=True) / self._max_accel_m_s2
        return accelerations / np.maximum(excess, 1.0)
