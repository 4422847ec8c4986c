"""Common part of the policies of few burns: each has its own law in transfers, and all keep station by a deadband."""

from abc import abstractmethod
from typing import Any

import numpy as np

from baselines.controllers.policy import AccelerationPolicy
from baselines.design.guidance import Guidance, GuidanceName
from baselines.design.mid_course_correction import CorrectionSettings, MidCourse
from baselines.design.station_keeping import StationKeeping, StationKeepingSettings
from formation_env.numerics.arrays import Array, Observations
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario


class FewBurns(AccelerationPolicy):
    """A subclass's law in transfers, and rare impulses in holds; each law is evaluated only in its rows."""

    def __init__(
        self,
        scenario: Scenario,
        settings: Any,
        guidance: GuidanceName,
        correction: CorrectionSettings,
        station_keeping: StationKeepingSettings,
    ) -> None:
        super().__init__(scenario, settings)
        self._layout = observation_layout(scenario)
        self._guidance = Guidance(scenario, guidance)
        self._course = MidCourse(scenario, correction)
        self._station_keeping = StationKeeping(scenario, station_keeping)

    @abstractmethod
    def transfer(self, observation: Observations) -> Array:
        """Accelerations (rows, 3) in a transfer, m/s^2, not cut to the limit, for observations (rows, SIZE)."""

    def hold(self, observation: Observations) -> Array:
        """Accelerations (rows, 3) in a hold, m/s^2, not cut to the limit, for observations (rows, SIZE)."""
        now = self._guidance.track(observation)
        return self._station_keeping.acceleration(now.error, now.at)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2, along the impulse even at the limit."""
        rows = observation.reshape(-1, observation.shape[-1])
        in_hold = self._layout.scalar(rows, "in_hold") > 0.5
        result = np.zeros((len(rows), 3))
        for law, chosen in ((self.hold, in_hold), (self.transfer, ~in_hold)):
            if chosen.any():
                result[chosen] = law(rows[chosen])
        return self.within_limit(result).reshape(*observation.shape[:-1], 3)
