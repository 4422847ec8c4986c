"""Colours, symbols and axes that all pictures share."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

NEUTRAL: Final = "#868b94"
"""Grey that reads on light and on dark."""
GRID: Final = "rgba(128, 134, 144, 0.25)"
SHADE: Final = "rgba(128, 134, 144, 0.20)"
FONT: Final = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"
MAX_POINTS: Final = 1500
"""Points of one line or cloud; longer ones are thinned out."""

# Okabe and Ito's colours, told apart by colour-blind readers; their black and yellow do not read on dark and on light.
_FIXED: Final = {
    "lqr": "#0072B2",
    "lqr_tracking": "#56B4E9",
    "smc": "#D55E00",
    "zero": NEUTRAL,
    "random": "#CC79A7",
}
_FREE: Final = ("#009E73", "#E69F00")
_SYMBOLS: Final = ("circle", "square", "triangle-up", "diamond", "x", "triangle-down", "star", "pentagon")
_DASHES: Final = ("solid", "dash", "dot", "dashdot")


@dataclass(frozen=True)
class Look:
    """How a policy is drawn, everywhere the same.

    Attributes:
        color: of dots and lines.
        symbol: of dots.
        dash: of lines.
    """

    color: str
    symbol: str
    dash: str


def looks(policies: Iterable[str]) -> dict[str, Look]:
    """The look of each policy: the known ones have their own, others get what is free, in order."""
    result: dict[str, Look] = {}
    free = 0
    for index, name in enumerate(dict.fromkeys(policies)):
        color, dash = _FIXED.get(name), "solid"
        if color is None:
            color, dash = _FREE[free % len(_FREE)], _DASHES[free // 2 % len(_DASHES)]
            free += 1
        result[name] = Look(color, _SYMBOLS[index % len(_SYMBOLS)], dash)
    return result


def thinned(length: int) -> np.ndarray:
    """Indices of at most MAX_POINTS of a sequence, evenly spaced, its ends included."""
    return np.unique(np.linspace(0, length - 1, min(length, MAX_POINTS)).round().astype(int))


def axis(title: str, log: bool = False) -> dict[str, Any]:
    """Settings of an axis with its title (quantity and unit)."""
    base = {"title": {"text": title, "standoff": 8}, "gridcolor": GRID, "zeroline": False, "automargin": True}
    return base | ({"type": "log", "tickformat": "~g", "dtick": 1, "minor": {"showgrid": False}} if log else {})


def base_layout(height: int) -> dict[str, Any]:
    """Layout that all figures share; the page's style sheet colours the text."""
    return {
        "template": "none",
        "height": height,
        "autosize": True,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": FONT, "size": 13, "color": NEUTRAL},
        "margin": {"l": 8, "r": 16, "t": 36, "b": 8},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": NEUTRAL, "activecolor": "#0072B2"},
        "hoverlabel": {"font": {"family": FONT, "size": 12}},
    }
