"""What acts on a spacecraft in the nonlinear truth, beside the Earth's gravity."""

from formation_env.settings import Flag, Positive, Real, settings


@settings
class Perturbations:
    """Switches of the nonlinear truth; the Earth's oblateness has its own, `orbit.j2`.

    Attributes:
        drag: whether the air brakes (Ma 2009, eq. 2.28).
        scale_height_m: of an exponential atmosphere that has the spacecraft's air density at the leader's altitude
            (eq. 2.30), m; without it the density is the same everywhere.
        sun: whether the Sun pulls (eq. 2.34).
        moon: whether the Moon pulls.
        radiation_pressure: whether sunlight pushes (eq. 2.41).
        epoch_jd: Julian date (TDB) of t = 0, by which the Sun and the Moon stand where they stand, days.
    """

    drag: Flag = True
    scale_height_m: Positive | None = None
    sun: Flag = False
    moon: Flag = False
    radiation_pressure: Flag = False
    epoch_jd: Real = 2451545.0

    @property
    def far_bodies(self) -> bool:
        """Whether anything depends on where the Sun or the Moon is."""
        return self.sun or self.moon or self.radiation_pressure
