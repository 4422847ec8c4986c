"""Sliding surfaces s = Ce e of the sliding mode controller. To add one: a class here, and a line in `SURFACES`.

Legend: e error, Ce (3, 6) with s in m, Phi and Gamma the filter's discrete model, Gamma_1 and Gamma_2 the rows of Gamma
for positions and velocities.
"""

from typing import Annotated, Final, Literal

import numpy as np

from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array
from formation_env.settings import OneOf, Positive, settings

PerAxis = tuple[Positive, Positive, Positive]


@settings
class GivenSurface:
    """Ce = [diag(position), diag(velocity_s)]; on the surface each axis decays at the rate position / velocity_s.

    Attributes:
        position: weights of the position errors.
        velocity_s: weights of the velocity errors, s.
    """

    kind: Literal["given"] = "given"
    position: PerAxis = (0.01, 0.05, 0.8)
    velocity_s: PerAxis = (500.0, 500.0, 500.0)

    def Ce(self, model: DiscreteModel, step_s: float) -> Array:  # noqa: N802
        """Surface (3, 6)."""
        return np.hstack([np.diag(self.position), np.diag(self.velocity_s)])


@settings
class PlacedSurface:
    """Ce from the eigenvalues of the motion on the surface, by the regular form (Ma 2009, eq. 4.33-4.52).

    Attributes:
        decay_per_s: on the surface each axis' error decays as exp(-decay t), 1/s.
    """

    kind: Literal["placed"] = "placed"
    decay_per_s: PerAxis = (1e-3, 1e-3, 1e-3)

    def Ce(self, model: DiscreteModel, step_s: float) -> Array:  # noqa: N802
        """Surface (3, 6), scaled so that s is about e + e' / decay."""
        decay = np.array(self.decay_per_s)
        Gamma_1, Gamma_2 = model.Gamma[:3], model.Gamma[3:]
        # T = [I, -Gamma_1 Gamma_2^-1; 0, Gamma_2^-1] (4.35)
        inverse = np.linalg.inv(Gamma_2)
        T = np.block([[np.eye(3), -Gamma_1 @ inverse], [np.zeros((3, 3)), inverse]])
        Phi = T @ model.Phi @ np.linalg.inv(T)
        # x_1(k+1) = (Phi_11 + Phi_12 K) x_1 with x_2 = K x_1 (4.48-4.50): as Phi_12 is square, it can be any matrix
        K = np.linalg.solve(Phi[:3, 3:], np.diag(np.exp(-decay * step_s)) - Phi[:3, :3])
        # Ce = Ce_2 [-K, I] (4.52) in the regular form's state T x
        surface: Array = np.diag(1 / decay) @ Gamma_2 @ np.hstack([-K, np.eye(3)]) @ T
        return surface


SURFACES: Final[dict[str, type]] = {"given": GivenSurface, "placed": PlacedSurface}
AnySurface = Annotated[GivenSurface | PlacedSurface, OneOf(SURFACES)]
