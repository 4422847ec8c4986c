"""The leader's position, from which missions start."""

from typing import Literal

import numpy as np

from formation_env.formations.base import Formation
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.settings import settings


@settings
class AtLeader(Formation):
    """At the leader, at rest."""

    kind: Literal["at_leader"] = "at_leader"

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,): zero."""
        return np.zeros(6)
