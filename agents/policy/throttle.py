"""How a network's output becomes thrust.

Exploration noise costs fuel, and a mission needs little of the greatest thrust for most of its time. So the network
speaks of a throttle z in [-1, 1], and the environment's action is sign(z) |z|^p: with p = 3 a noise of 0.1 about
coasting is a thousandth of the greatest thrust, while that itself stays in reach.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from torch import Tensor


def throttle(z: NDArray[np.float32], power: float) -> NDArray[np.float32]:
    """The environment's actions sign(z) |z|^power for throttles z (..., 3), both in [-1, 1] and of the same shape."""
    thrust: NDArray[Any] = np.copysign(np.abs(z) ** power, z)
    return thrust


def thrust_of(z: "Tensor", power: float) -> "Tensor":
    """The same of torch's tensors, with a gradient at zero, too."""
    return z * z.abs() ** (power - 1)
