"""Throttle: the nonlinear map from a network's output to a thrust.

Exploration noise costs fuel, and a mission needs a small fraction of the maximum thrust most of the time. So the
network's output is a throttle z in [-1, 1], and the environment's action is sign(z) |z|^p: with p = 3 a noise of 0.1
about coasting is a thousandth of the maximum thrust, which remains within reach.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from torch import Tensor


def throttle(z: NDArray[np.floating[Any]], power: float) -> NDArray[np.float32]:
    """The environment's actions sign(z) |z|^power for throttles z (..., 3), both in [-1, 1] and of the same shape."""
    thrust: NDArray[Any] = np.copysign(np.abs(z) ** power, z)
    return thrust


def thrust_of(z: "Tensor", power: float) -> "Tensor":
    """`throttle` for tensors of torch; differentiable at zero for power >= 1."""
    return z * z.abs() ** (power - 1)
