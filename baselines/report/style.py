"""Colours, symbols and axes that all figures share."""

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
"""Points of a line or cloud; longer ones are thinned out."""


@dataclass(frozen=True)
class Look:
    """How a policy is drawn in every figure.

    Attributes:
        color: of dots and lines.
        symbol: of dots.
        dash: of lines.
    """

    color: str
    symbol: str
    dash: str


# Based on Okabe and Ito's colours, which colour-blind readers can tell apart; all have a contrast of 3 or more on the
# light and on the dark page. They are too few, so symbols differ everywhere, and dashes where two colours are close.
_FIXED: Final = {
    "lqr": Look("#0072B2", "circle", "solid"),
    "lqr_nominal": Look("#6C5CE7", "hexagram", "dashdot"),
    "mpc": Look("#C2408A", "star", "solid"),
    "lqr_finite": Look("#8E7CC3", "diamond", "dot"),
    "lqr_quasi_static": Look("#3D9BD1", "square", "dash"),
    "smc": Look("#D55E00", "triangle-up", "solid"),
    "two_impulse": Look("#CC79A7", "triangle-down", "solid"),
    "deadband": Look("#9A7B2C", "pentagon", "dash"),
    "zero": Look(NEUTRAL, "x", "dot"),
    "random": Look(NEUTRAL, "cross", "dashdot"),
}
_FREE_COLORS: Final = ("#009E73", "#C98500")
_FREE_SYMBOLS: Final = ("hexagon", "hourglass", "bowtie", "diamond-tall")
_FREE_DASHES: Final = ("solid", "dash", "dot", "dashdot")


def looks(policies: Iterable[str]) -> dict[str, Look]:
    """The look of each policy: classical policies have fixed looks, others get free ones in order."""
    names = list(dict.fromkeys(policies))
    places = {name: place for place, name in enumerate(name for name in names if name not in _FIXED)}
    return {name: _FIXED[name] if name in _FIXED else _free(places[name]) for name in names}


def _free(place: int) -> Look:
    """A look that no classical policy has."""
    color, dash = place % len(_FREE_COLORS), place // len(_FREE_COLORS) % len(_FREE_DASHES)
    return Look(_FREE_COLORS[color], _FREE_SYMBOLS[place % len(_FREE_SYMBOLS)], _FREE_DASHES[dash])


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
