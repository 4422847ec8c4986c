"""What a formation offers."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.base import Array
from formation_env.dynamics.hcw import transition_matrix
from formation_env.orbit import Orbit


class Formation(ABC):
    """A relative orbit, given by its LVLH state at one instant."""

    kind: str

    @abstractmethod
    def state(self, orbit: Orbit) -> Array:
        """LVLH state (6,) at t = 0, m and m/s."""

    def reference(self, times_s: ArrayLike, orbit: Orbit) -> Array:
        """The force-free HCW path through `state`, states (..., 6) at times (...), s, before and after t = 0."""
        path: Array = transition_matrix(orbit.mean_motion_rad_s, times_s) @ self.state(orbit)
        return path


def closed_ellipse(x0: float, vx0: float, z_per_x: float, mean_motion_rad_s: float) -> Array:
    """State (6,) of a leader-centred ellipse without drift (Ma 2009, section 3.1).

    No drift needs y0' = -2 n x0; centred on the leader, y0 = 2 x0' / n; the cross-track motion is z_per_x times the
    radial one, in phase with it.
    """
    n = mean_motion_rad_s
    return np.array([x0, 2 * vx0 / n, z_per_x * x0, vx0, -2 * n * x0, z_per_x * vx0])
