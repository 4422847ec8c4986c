"""Outages at given times."""

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from formation_env.dropout.base import Dropout
from formation_env.numerics.arrays import Array
from formation_env.quantities import Duration, PositiveDuration
from formation_env.settings import settings

TOLERANCE: Final = 1e-12
"""Relative error of an instant k dt that rounding may cause; at most a millionth of a step, as k is at most 1e6."""


@settings
class Window:
    """One outage, [start, start + duration).

    Attributes:
        start_s: first instant without measurements, s after the episode's start.
        duration_s: how long it lasts, s.
    """

    start_s: Duration
    duration_s: PositiveDuration


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
        # k dt may round to just below the decimal that the settings name: an instant so close to an end is at it
        latest = times_s * (1 + TOLERANCE)
        for window in self.windows:
            covered |= (window.start_s <= latest) & (latest < window.start_s + window.duration_s)
        return covered
