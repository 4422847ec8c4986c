"""How a network is shown an observation.

Errors are scaled by the size of the whole formation: of a circle of 2 km, 10 m are 0.005. The logarithms beside them
are of order 1, but sums of position and velocity, of which every linear law consists, cannot be told from logarithms.
So errors are magnified, and cut off where the logarithms suffice.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.task.observation import SIZE, SLICES

MAGNIFIED: Final = slice(SLICES["error"].start, SLICES["zero_effort_miss"].stop)
"""The blocks `error` and `zero_effort_miss`, which stand side by side."""
REST: Final = slice(SLICES["reference"].start, SIZE)
"""What of an observation does not depend on the state: plan, clock and filter."""
CUT: Final = 5.0
"""No feature is beyond this."""


def features(observation: NDArray[np.float32], magnification: float) -> NDArray[np.float32]:
    """What a network reads (..., SIZE) of observations (..., SIZE); those stay as they are, and with 1 are read so."""
    if magnification == 1:
        return observation
    shown = observation.copy()
    shown[..., MAGNIFIED] *= np.float32(magnification)
    return np.clip(shown, -CUT, CUT, out=shown)
