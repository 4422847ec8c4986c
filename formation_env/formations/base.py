"""Interface of formations."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.hcw import transition_matrix
from formation_env.dynamics.yamanaka_ankersen import transition_matrix as elliptic_transition_matrix
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import MU_EARTH
from formation_env.orbital.orbit import Orbit

FORMATIONS: "dict[str, type[Formation]]" = {}
"""Formations by `kind`, filled in where the package puts them together; see `register_formation`."""


class Formation(ABC):
    """A relative orbit, given by its LVLH state at one instant.

    Subclasses are made with `settings`; those that define their own `kind` can be registered.
    """

    kind: str = "custom"

    @abstractmethod
    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s, at the time at which the formation begins, s (it matters on an ellipse only)."""

    def slots(self, count: int, orbit: Orbit) -> "tuple[Formation, ...]":
        """The formation of the follower in each of `count` slots.

        Raises:
            ValueError: the formation has one place only, and there are several followers.
        """
        if count > 1:
            raise ValueError(
                f"formation {self.kind}: has one place for {count} followers; train, list, and the circles and "
                "ellipses about the leader have several"
            )
        return (self,)

    def reference(self, times_s: ArrayLike, orbit: Orbit, begin_s: float = 0.0) -> Array:
        """States (..., 6) of the force-free Keplerian path through `state`, before and after the formation begins.

        Args:
            times_s: times (...), s.
            orbit: the leader's orbit.
            begin_s: time at which the follower has `state`, s.
        """
        if orbit.eccentricity > 0:
            Phi = elliptic_transition_matrix(orbit, begin_s, times_s)
        else:
            Phi = transition_matrix(orbit.mean_motion_rad_s, np.asarray(times_s, float) - begin_s)
        path: Array = Phi @ self.state(orbit, begin_s)
        return path


def closed_ellipse(x0: float, vx0: float, z_per_x: float, orbit: Orbit, time_s: float) -> Array:
    """State (6,) of a leader-centred ellipse without drift (Ma 2009, section 3.1).

    On a circular orbit no drift needs y0' = -2 n x0; centred on the leader, y0 = 2 x0' / n; the cross-track motion is
    z_per_x times the radial one, in phase with it. On an ellipse y0' follows from equal energies.
    """
    y0 = 2 * vx0 / orbit.mean_motion_rad_s
    return np.array([x0, y0, z_per_x * x0, vx0, closing_speed(x0, y0, vx0, orbit, time_s), z_per_x * vx0])


def closing_speed(x0: float, y0: float, vx0: float, orbit: Orbit, time_s: float) -> float:
    """The along-track velocity, m/s, with which a follower has the leader's energy to first order, so its period."""
    r, speed, rate = orbit.polar_motion(time_s)
    # r' (x' - theta' y) + r theta' (y' + theta' x) + mu x / r^2 = 0
    return -rate * x0 - (speed * (vx0 - rate * y0) + MU_EARTH * x0 / r**2) / (r * rate)


def need_circle(kind: str, orbit: Orbit) -> None:
    """Refuse an elliptic orbit.

    Raises:
        ValueError: the leader's orbit is not circular.
    """
    if orbit.eccentricity > 0:
        raise ValueError(f"formation {kind}: needs a circular orbit, got eccentricity {orbit.eccentricity:g}")
