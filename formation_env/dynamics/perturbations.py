"""Perturbations of the nonlinear truth."""

from typing import Annotated

from pydantic import Field

from formation_env.settings import Flag, Positive, Real, settings

JulianDate = Annotated[Real, Field(ge=2415020.5, le=2488069.5)]
"""Days from 1900-01-01 to 2100-01-01, between which the positions of the Sun and the Moon are known."""


@settings
class Perturbations:
    """Forces of the nonlinear truth beside the Earth's gravity; the Earth's oblateness is switched by `orbit.j2`.

    Attributes:
        drag: whether the air brakes (Ma 2009, eq. 2.28).
        scale_height_m: of an exponential atmosphere that has the spacecraft's air density at the leader's altitude
            (eq. 2.30), m; without it the density is the same everywhere.
        sun: whether the Sun pulls (eq. 2.34).
        moon: whether the Moon pulls.
        radiation_pressure: whether sunlight pushes (eq. 2.41).
        epoch_jd: Julian date (TDB) of t = 0, from which the positions of the Sun and the Moon follow, days.
    """

    drag: Flag = True
    scale_height_m: Positive | None = None
    sun: Flag = False
    moon: Flag = False
    radiation_pressure: Flag = False
    epoch_jd: JulianDate = 2451545.0

    @property
    def far_bodies(self) -> bool:
        """Whether anything depends on where the Sun or the Moon is."""
        return self.sun or self.moon or self.radiation_pressure
