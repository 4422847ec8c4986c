"""Axes that fit values, and buttons that go from the close-up to all."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

LOG_FROM = 8.0
"""An axis is logarithmic if its values span more than this ratio."""
_FEW_DECADES = 1.5


@dataclass(frozen=True)
class Scale:
    """One axis.

    Attributes:
        log: whether it is logarithmic.
        low: its start.
        high: its end.
    """

    log: bool
    low: float
    high: float

    @classmethod
    def fit(cls, values: np.ndarray) -> Self:
        """An axis that holds values (any shape), with a margin."""
        low, high = float(values.min()), float(values.max())
        if low > 0 and high > LOG_FROM * low:
            pad = (high / low) ** 0.06
            return cls(True, low / pad, high * pad)
        pad = 0.08 * ((high - low) or abs(high) or 1.0)
        return cls(False, low - pad, high + pad)

    def settings(self, axis: str) -> dict[str, Any]:
        """Entries of plotly's layout for the axis `xaxis` or `yaxis`."""
        ends = [math.log10(self.low), math.log10(self.high)] if self.log else [self.low, self.high]
        wide = self.log and ends[1] - ends[0] > _FEW_DECADES
        return {
            f"{axis}.type": "log" if self.log else "linear",
            f"{axis}.range": ends,
            f"{axis}.tickformat": "~g",
            f"{axis}.dtick": 1 if wide else "D2" if self.log else None,
        }

    def grid(self, below: float) -> np.ndarray:
        """Positions from the start up to `below` for a smooth line, closer together towards its end."""
        low, top = max(self.low, 0.0), min(below, self.high)
        if top <= low:
            return np.empty(0)
        even = np.geomspace(low, top, 80) if low > 0 else np.linspace(low, top, 80)
        near = below - np.geomspace(0.2 * below, 1e-6 * below, 60)
        return np.unique(np.concatenate([even, near[(near > low) & (near < top)]]))


def without_zeros(values: np.ndarray) -> np.ndarray:
    """Values for an axis that may be logarithmic: zeros moved to half of the least positive one."""
    positive = values[values > 0]
    return np.maximum(values, positive.min() / 2) if positive.size else values


def round_values(low: float, high: float, at_most: int = 7) -> list[float]:
    """A few round values between two positive ones."""
    first, last = math.floor(math.log10(max(low, 1e-6))), math.ceil(math.log10(high))
    for digits in ((1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9), (1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        values = [digit * 10.0**decade for decade in range(first, last + 1) for digit in digits]
        values = [value for value in values if low < value < high]
        if len(values) <= at_most:
            return values
    return values[-at_most:]


def view_buttons(labels: list[str], updates: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """A row of buttons, one per view; each applies [changes of traces, changes of layout]."""
    buttons = [
        {"label": label, "method": "update", "args": update} for label, update in zip(labels, updates, strict=True)
    ]
    look = {"bgcolor": "rgba(128,134,144,0.15)", "bordercolor": "rgba(128,134,144,0.4)", "font": {"size": 12}}
    place = {"direction": "right", "x": 0, "xanchor": "left", "y": 1.0, "yanchor": "bottom", "pad": {"b": 6, "t": 0}}
    return {"type": "buttons", "buttons": buttons, "showactive": False} | look | place
