"""What any controller should beat: no thrust, and random thrust."""

from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from baselines.controllers.policy import AccelerationPolicy
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import settings
from formation_env.task.scenario import Scenario


@settings
class ZeroSettings:
    """Coasting has no gains."""


class Zero(AccelerationPolicy):
    """Coast."""

    Settings = ZeroSettings

    def __init__(self, scenario: Scenario, gains: ZeroSettings) -> None:
        super().__init__(scenario)

    def acceleration(self, observation: Observations) -> Array:
        """Zeros (..., 3), m/s^2."""
        return np.zeros((*observation.shape[:-1], 3))


@settings
class RandomSettings:
    """Random thrust.

    Attributes:
        seed: of the policy's own random generator.
    """

    seed: Annotated[int, Strict(), Field(ge=0)] = 0


class Random(AccelerationPolicy):
    """Uniform over the action space. It draws anew at each call, be it asked for deterministic actions or not."""

    Settings = RandomSettings

    def __init__(self, scenario: Scenario, gains: RandomSettings) -> None:
        super().__init__(scenario)
        self._generator = np.random.default_rng(gains.seed)

    def acceleration(self, observation: Observations) -> Array:
        """Uniform accelerations (..., 3) up to the limit of each axis, m/s^2."""
        return self._max_accel_m_s2 * self._generator.uniform(-1.0, 1.0, (*observation.shape[:-1], 3))
