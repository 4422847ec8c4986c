"""Colours, symbols and axes that all figures share."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from baselines.controllers.registry import POLICIES

NEUTRAL: Final = "#868b94"
"""Grey that reads on light and on dark."""
GRID: Final = "rgba(128, 134, 144, 0.25)"
SHADE: Final = "rgba(128, 134, 144, 0.20)"
FONT: Final = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"
MAX_POINTS: Final = 1500
"""Points of a line or cloud; longer ones are thinned out."""


@dataclass(frozen=True)
class Look:
    """Look of a policy in every figure.

    Attributes:
        color: of dots and lines.
        symbol: of dots.
        dash: of lines.
    """

    color: str
    symbol: str
    dash: str


# The policies' classes state their looks, in colours based on Okabe and Ito's, which colour-blind readers can tell
# apart; all have a contrast of 3 or more on the light and on the dark page. They are too few, so symbols differ
# everywhere, and dashes where two colours are close.
_FREE_COLORS: Final = ("#009E73", "#C98500")
_FREE_SYMBOLS: Final = ("hexagon", "hourglass", "bowtie", "diamond-tall")
_FREE_DASHES: Final = ("solid", "dash", "dot", "dashdot")


def looks(policies: Iterable[str]) -> dict[str, Look]:
    """The look of each policy: that of its class, else the next free one, in order."""
    names = list(dict.fromkeys(policies))
    stated = {name: look for name in names if (look := _stated(name)) is not None}
    places = {name: place for place, name in enumerate(name for name in names if name not in stated)}
    return {name: stated[name] if name in stated else _free(places[name]) for name in names}


def _stated(name: str) -> Look | None:
    """The look that a policy's class states; None if it states none, or the policy is a learned one."""
    policy = POLICIES.get(name)
    if policy is None:
        return None
    color = policy.color or (NEUTRAL if policy.is_reference else None)
    return None if color is None else Look(color, policy.symbol, policy.dash)


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
