"""Diagonal weights of the quadratic costs."""

import numpy as np

from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.settings import NonNegative, Positive, settings


@settings
class Weights:
    """Cost x' Q x + u' R u with diagonal weights, R = diag(control_s2) / n^2 as in Ma 2009, section 5.2.

    Only ratios matter; the thesis has position = velocity_s2 = 1.

    Attributes:
        position: weight of each axis' squared position error.
        velocity_s2: weight of each axis' squared velocity error, s^2.
        control_s2: weight of each axis' squared acceleration times n^2, s^2.
    """

    position: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 1.0)
    velocity_s2: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 1.0)
    control_s2: tuple[Positive, Positive, Positive] = (1.0, 1.0, 1.0)

    def Q(self) -> Array:  # noqa: N802
        """State weight (6, 6): 1 for positions, s^2 for velocities."""
        return np.diag([*self.position, *self.velocity_s2]).astype(float)

    def R(self, orbit: Orbit) -> Array:  # noqa: N802
        """Control weight (3, 3), s^4."""
        return np.diag(self.control_s2) / orbit.mean_motion_rad_s**2
