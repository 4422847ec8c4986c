"""Followers each in a formation of its own."""

from typing import Annotated, Literal

from formation_env.formations.base import FORMATIONS, Formation
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.settings import OneOf, settings


@settings
class Listed(Formation):
    """A list of formations: the follower in slot i flies the i-th.

    Attributes:
        formations: one for each follower; a list within the list is refused.
    """

    kind: Literal["list"] = "list"
    formations: tuple[Annotated[Formation, OneOf(FORMATIONS, but="list")], ...]

    def slots(self, count: int, orbit: Orbit) -> tuple[Formation, ...]:
        """The place of each follower.

        Raises:
            ValueError: the list has another length.
        """
        if len(self.formations) != count:
            raise ValueError(f"formations: must have {count}, one for each follower, got {len(self.formations)}")
        return self.formations

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,) of slot 0, m and m/s."""
        return self.formations[0].state(orbit, time_s)
