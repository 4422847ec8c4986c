"""Reference policies that every controller should beat: no thrust, and random thrust."""

from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from baselines.controllers.policy import AccelerationPolicy
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import settings
from formation_env.task.scenario import Scenario


@settings
class ZeroSettings:
    """Coasting has no settings."""


class Zero(AccelerationPolicy):
    """Coast."""

    name = "zero"
    Settings = ZeroSettings
    is_reference = True
    symbol, dash = "x", "dot"

    def acceleration(self, observation: Observations) -> Array:
        """Zeros (..., 3), m/s^2."""
        return np.zeros((*observation.shape[:-1], 3))


@settings
class RandomSettings:
    """Settings of `random`.

    Attributes:
        seed: of the policy's own random generator.
    """

    seed: Annotated[int, Strict(), Field(ge=0)] = 0


class Random(AccelerationPolicy):
    """Uniform over the action space, drawn anew at each call, even if deterministic actions are asked for."""

    name = "random"
    Settings = RandomSettings
    settings: RandomSettings
    is_reference = True
    symbol, dash = "cross", "dashdot"

    def __init__(self, scenario: Scenario, settings: RandomSettings) -> None:
        super().__init__(scenario, settings)
        self._generator = np.random.default_rng(settings.seed)

    def acceleration(self, observation: Observations) -> Array:
        """Uniform accelerations (..., 3) up to the limit of each axis, m/s^2."""
        return self._max_accel_m_s2 * self._generator.uniform(-1.0, 1.0, (*observation.shape[:-1], 3))
