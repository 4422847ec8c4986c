"""Base class of all policies: a law from the observation to an acceleration, and what others need to know about it."""

from abc import ABC, abstractmethod
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np

from baselines.controllers.search_space import Parameter
from formation_env.numerics.arrays import Actions, Array, Observations
from formation_env.task.scenario import Scenario


class AccelerationPolicy(ABC):
    """A policy without memory, with Stable-Baselines3's `predict`.

    A subclass states everything that commands, reports and tuning studies need to know about it.

    Attributes:
        scenario: scenario that it is made for.
        settings: its settings, of the class `Settings`.
        name: name in `POLICIES`, in settings files and on the command line.
        Settings: class of its settings, made with `formation_env.settings.settings`.
        search_space: settings that a tuning study varies, all of them in default.yaml; empty if it has none.
        library: library that it needs beside the package's own dependencies, of the extra `optimal`.
        slow: whether the time per action is about a hundred times a gain matrix's, so that reports fly fewer episodes.
        is_reference: whether it is there to be beaten by every controller; sweeps and close-ups leave it out.
        proportional: whether small errors ask for small thrusts, which a thruster with a minimum thrust does not give.
        color: colour in figures; by default grey for a reference policy, else the next free one.
        symbol: plotly's marker symbol.
        dash: plotly's line style.
    """

    name: ClassVar[str]
    Settings: ClassVar[type[Any]]
    search_space: ClassVar[tuple[Parameter, ...]] = ()
    library: ClassVar[str | None] = None
    slow: ClassVar[bool] = False
    is_reference: ClassVar[bool] = False
    proportional: ClassVar[bool] = False
    color: ClassVar[str | None] = None
    symbol: ClassVar[str] = "circle"
    dash: ClassVar[str] = "solid"

    def __init__(self, scenario: Scenario, settings: Any) -> None:
        self.scenario, self.settings = scenario, settings
        self._max_accel_m_s2 = scenario.spacecraft.max_accel_m_s2

    @classmethod
    def is_available(cls) -> bool:
        """Whether the library that it needs is installed."""
        return cls.library is None or find_spec(cls.library) is not None

    @abstractmethod
    def acceleration(self, observation: Observations) -> Array:
        """Commanded accelerations (..., 3), m/s^2, for observations (..., SIZE)."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """Actions for one observation or for a batch, with the signature of Stable-Baselines3's policies.

        Args:
            observation: (SIZE,) or (rows, SIZE).
            state: returned unchanged.
            episode_start: not used.
            deterministic: not used.

        Returns:
            Actions (3,) or (rows, 3), float32, in units of max_accel_m_s2 and cut to [-1, 1]; and `state`.
        """
        accelerations = self.acceleration(np.asarray(observation, np.float32))
        return np.clip(accelerations / self._max_accel_m_s2, -1.0, 1.0).astype(np.float32), state

    def within_limit(self, accelerations: Array) -> Array:
        """Accelerations (..., 3), m/s^2, shortened so that no axis is beyond the limit; their directions stay."""
        excess = np.abs(accelerations).max(axis=-1, keepdims=True) / self._max_accel_m_s2
        return np.asarray(accelerations / np.maximum(excess, 1.0))
