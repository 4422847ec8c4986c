"""Followers one behind the other on the leader's orbit."""

from typing import Literal

from formation_env.formations.base import Formation
from formation_env.formations.lines import Following
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate
from formation_env.settings import settings


@settings
class Train(Formation):
    """A train along the leader's track: the follower in slot i flies at y0 + i spacing.

    Attributes:
        y0_m: along-track offset of slot 0, m; positive is ahead.
        spacing_m: from each slot to the next, m; negative puts the next one behind.
    """

    kind: Literal["train"] = "train"
    y0_m: Coordinate = -1000.0
    spacing_m: Coordinate = -300.0

    def slots(self, count: int, orbit: Orbit) -> tuple[Formation, ...]:
        """The place of each follower."""
        return tuple(Following(y0_m=self.y0_m + i * self.spacing_m) for i in range(count))

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,) of slot 0, m and m/s."""
        return Following(y0_m=self.y0_m).state(orbit, time_s)
