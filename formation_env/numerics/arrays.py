"""Array types of the project."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


Array32 = NDArray[np.float32]


Observations = NDArray[np.float32]


Actions = NDArray[np.float32]
