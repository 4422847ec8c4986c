"""Outages at given times."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from formation_env.dropout.base import Dropout
from formation_env.numerics.arrays import Array
from formation_env.settings import NonNegative, Positive, settings


@settings
class Window:
    """One outage, [start, start + duration).

    Attributes:
        start_s: first instant without measurements, s after the episode's start.
        duration_s: how long it lasts, s.
    """

    start_s: NonNegative
    duration_s: Positive


@settings
class Windows(Dropout):
    """Outages at known times; the thesis's failure is [0, 3000 s) (Ma 2009, section 5.2.2).

    Attributes:
        windows: the outages; they may overlap.
    """

    kind: Literal["windows"] = "windows"
    windows: tuple[Window, ...] = (Window(start_s=0.0, duration_s=3000.0),)

    def closed(self, times_s: Array) -> NDArray[np.bool_]:
        """Whether a window covers each of the times (T,), s."""
        covered = np.zeros(len(times_s), bool)
        for window in self.windows:
            covered |= (window.start_s <= times_s) & (times_s < window.start_s + window.duration_s)
        return covered
