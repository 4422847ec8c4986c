"""Settings of the relative navigation sensor."""

from typing import Annotated, Literal

from pydantic import Field

from formation_env.settings import NonNegative, settings

Sigma = Annotated[NonNegative, Field(le=1e9)]
"""1-sigma of a position, m, a velocity, m/s, or an acceleration, m/s^2: up to a million km, far from overflow."""


@settings
class Sensor:
    """Relative navigation sensor with independent white errors.

    Attributes:
        measures: position and velocity, or position only.
        sigma_pos_m: 1-sigma of each position axis, m.
        sigma_vel_m_s: 1-sigma of each velocity axis, m/s.
    """

    measures: Literal["position_and_velocity", "position"] = "position_and_velocity"
    sigma_pos_m: Sigma = 2.0
    sigma_vel_m_s: Sigma = 0.02
