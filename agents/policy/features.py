"""Network input: the observation with magnified errors.

Errors are scaled by the size of the whole formation: for a circle of 2 km, 10 m are 0.005. The logarithms beside them
are of order 1, but sums of position and velocity, of which every linear law consists, cannot be formed from logarithms.
So errors are magnified, and clipped where the logarithms suffice.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.task.observation import SIZE, SLICES

MAGNIFIED: Final = slice(SLICES["error"].start, SLICES["zero_effort_miss"].stop)
"""The adjacent blocks `error` and `zero_effort_miss`."""
REST: Final = slice(SLICES["reference"].start, SIZE)
"""Part of an observation that does not depend on the state: plan, clock and filter."""
CUT: Final = 5.0
"""Magnitude at which features are clipped."""


def features(observation: NDArray[np.float32], magnification: float) -> NDArray[np.float32]:
    """Network input (..., SIZE) for observations (..., SIZE), which are not changed; 1 leaves them unmagnified."""
    if magnification == 1:
        return observation
    shown = observation.copy()
    shown[..., MAGNIFIED] *= np.float32(magnification)
    return np.clip(shown, -CUT, CUT, out=shown)
