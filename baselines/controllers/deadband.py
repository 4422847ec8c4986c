"""Few burns: a planned transfer with mid-course corrections, and station keeping by a deadband."""

from typing import Literal

import numpy as np

from baselines.controllers.few_burns import FewBurns
from baselines.controllers.lookup import look_up
from baselines.controllers.search_space import CORRECTION, STATION_KEEPING, Parameter
from baselines.design.mid_course_correction import CorrectionSettings
from baselines.design.phase_tables import by_steps_left
from baselines.design.station_keeping import StationKeepingSettings
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, settings
from formation_env.task.scenario import Scenario


@settings(renamed={"keeping": "station_keeping"})
class DeadbandSettings:
    """Settings of `deadband`.

    Attributes:
        guidance: the transfers' path, see `baselines.design.guidance`.
        least_thrust: thrust of the path below this share of the limit is left out; corrections make up for it.
        correction: when the follower is brought back to it.
        station_keeping: the hold's deadband.
    """

    guidance: Literal["least_fuel", "two_impulse"] = "least_fuel"
    least_thrust: NonNegative = 0.02
    correction: CorrectionSettings = CorrectionSettings()
    station_keeping: StationKeepingSettings = StationKeepingSettings()


class Deadband(FewBurns):
    """In a transfer the path's own thrust and corrections of the miss at its end; in a hold rare impulses."""

    name = "deadband"
    Settings = DeadbandSettings
    settings: DeadbandSettings
    search_space = (Parameter(("least_thrust",), 1e-3, 0.5, transfer=True), *CORRECTION, *STATION_KEEPING)
    color, symbol, dash = "#9A7B2C", "pentagon", "dash"

    def __init__(self, scenario: Scenario, settings: DeadbandSettings) -> None:
        super().__init__(scenario, settings, settings.guidance, settings.correction, settings.station_keeping)
        model = scenario.filter_dynamics()
        to_accel = by_steps_left(scenario, lambda leg: np.linalg.pinv(model.steps(leg.start, leg.end).Gamma))
        own = (to_accel @ self._guidance.residuals[..., None])[..., 0]
        least = settings.least_thrust * scenario.spacecraft.max_accel_m_s2
        self._own_thrust = np.where(np.linalg.norm(own, axis=-1, keepdims=True) >= least, own, 0.0)

    def transfer(self, observation: Observations) -> Array:
        """Accelerations (rows, 3), m/s^2, not cut to the limit."""
        now = self._guidance.track(observation)
        miss = (self._course.coast(now.at) @ now.error[..., None])[..., :3, 0]
        off = self._course.is_off(miss, observation, now.at)
        impulse = np.where(off[..., None], self._course.impulse(miss, now.at), 0.0)
        return look_up(self._own_thrust, now.at) + impulse / self.scenario.dt_s
