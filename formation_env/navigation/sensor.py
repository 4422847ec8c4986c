"""Settings of the relative navigation sensor."""

from typing import Literal

from formation_env.quantities import Distance, Speed
from formation_env.settings import settings


@settings
class Sensor:
    """Relative navigation sensor with independent white errors.

    Attributes:
        measures: position and velocity, or position only.
        sigma_pos_m: 1-sigma of each position axis, m.
        sigma_vel_m_s: 1-sigma of each velocity axis, m/s.
    """

    measures: Literal["position_and_velocity", "position"] = "position_and_velocity"
    sigma_pos_m: Distance = 2.0
    sigma_vel_m_s: Speed = 0.02
