"""Reaching laws and the relay, which bring the sliding mode controller to its surface.

To add a law: a class with `change` here, and a line in `REACHING_LAWS`.
"""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from formation_env.numerics.arrays import Array
from formation_env.settings import NonNegative, OneOf, Positive, settings


@settings
class ConstantReaching:
    """s' = -eps sgn s (Ma 2009, eq. 4.53).

    Attributes:
        eps_m_s: speed of approach, m/s.
    """

    kind: Literal["constant"] = "constant"
    eps_m_s: Positive = 0.05

    def change(self, s: Array, sign: Array, step_s: float) -> Array:
        """Change of s (..., 3) over a step, m."""
        return -self.eps_m_s * step_s * sign


@settings
class ExponentialReaching:
    """s' = -eps sgn s - q s (Ma 2009, eq. 4.54).

    Attributes:
        eps_m_s: speed of approach near the surface, m/s.
        q_per_s: rate of approach far from it, 1/s.
    """

    kind: Literal["exponential"] = "exponential"
    eps_m_s: NonNegative = 0.005
    q_per_s: Positive = 0.0055

    def change(self, s: Array, sign: Array, step_s: float) -> Array:
        """Change of s (..., 3) over a step, m (eq. 4.56)."""
        return -self.eps_m_s * step_s * sign - self.q_per_s * step_s * s


@settings
class PowerReaching:
    """s' = -k |s|^alpha sgn s (Ma 2009, eq. 4.55), with s in m and s' in m/s.

    Attributes:
        k_m_s: speed of approach at a distance of 1 m, m/s.
        alpha: exponent.
    """

    kind: Literal["power"] = "power"
    k_m_s: Positive = 0.05
    alpha: Annotated[Positive, Field(lt=1)] = 0.5

    def change(self, s: Array, sign: Array, step_s: float) -> Array:
        """Change of s (..., 3) over a step, m."""
        return -self.k_m_s * step_s * np.abs(s) ** self.alpha * sign


@settings
class Relay:
    """u = u0 sgn s on each axis, whatever model and path (Ma 2009, eq. 4.23, 4.28-4.30).

    It reaches the surface if u0 exceeds all else that accelerates the error, u0 > f0 + |r'| there.

    Attributes:
        u0_m_s2: acceleration of each axis, m/s^2.
    """

    kind: Literal["relay"] = "relay"
    u0_m_s2: Positive = 0.002


REACHING_LAWS: Final[dict[str, type]] = {
    "constant": ConstantReaching,
    "exponential": ExponentialReaching,
    "power": PowerReaching,
    "relay": Relay,
}
AnyReaching = Annotated[ConstantReaching | ExponentialReaching | PowerReaching | Relay, OneOf(REACHING_LAWS)]
