"""Transfers by two impulses, planned anew from the estimate; station keeping by a deadband."""

import numpy as np

from baselines.controllers.few_burns import FewBurns
from baselines.controllers.search_space import CORRECTION, STATION_KEEPING, Parameter
from baselines.design.mid_course_correction import CorrectionSettings
from baselines.design.station_keeping import StationKeepingSettings
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, settings
from formation_env.task.scenario import Scenario

_LEAST_BURN_STEPS = 1.01
"""Latest beginning of the braking burn, in steps before the arrival; above 1, so that rounding cannot skip it."""


@settings(renamed={"keeping": "station_keeping"})
class TwoImpulseSettings:
    """Settings of `two_impulse`.

    Attributes:
        correction: when the first impulse is given, and corrected on the way.
        braking: share of the second impulse's burn that lies before the arrival.
        station_keeping: the hold's deadband.
    """

    correction: CorrectionSettings = CorrectionSettings()
    braking: NonNegative = 0.5
    station_keeping: StationKeepingSettings = StationKeepingSettings()


class TwoImpulsePolicy(FewBurns):
    """In a transfer the impulse that leads to the goal, later the one that stops there; each as a burn at the limit.

    It has no plan in memory: the estimate's zero-effort miss gives what is left of an impulse.
    """

    name = "two_impulse"
    Settings = TwoImpulseSettings
    settings: TwoImpulseSettings
    search_space = (*CORRECTION, Parameter(("braking",), 0, 1.5, log=False, transfer=True), *STATION_KEEPING)
    color, symbol = "#CC79A7", "triangle-down"

    def __init__(self, scenario: Scenario, settings: TwoImpulseSettings) -> None:
        super().__init__(scenario, settings, "automatic", settings.correction, settings.station_keeping)

    def transfer(self, observation: Observations) -> Array:
        """Accelerations (rows, 3), m/s^2, not cut to the limit."""
        now = self._guidance.track(observation)
        arrival = self._layout.state(observation, "zero_effort_miss")
        first = self._course.impulse(arrival[..., :3], now.at)
        off = self._course.is_off(arrival[..., :3], observation, now.at)
        brakes = self._layout.time_to_arrival_s(observation) <= self._braking_s(arrival[..., 3:])
        impulse = np.where(brakes[..., None], -arrival[..., 3:], np.where(off[..., None], first, 0.0))
        return impulse / self.scenario.dt_s

    def _braking_s(self, velocity_m_s: Array) -> Array:
        """Lead time (...) of the burn against a velocity (..., 3) before the arrival, s; at least a step."""
        burn_s = np.abs(velocity_m_s).max(axis=-1) / self._max_accel_m_s2
        return np.asarray(np.maximum(self.settings.braking * burn_s, _LEAST_BURN_STEPS * self.scenario.dt_s))
