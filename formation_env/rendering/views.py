"""One projection of the scene onto axes, and how its parts look."""

from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from formation_env.dynamics.base import Array
from formation_env.rendering.moment import Moment

SIGMAS: Final = 3.0
"""Size of the drawn ellipse, in standard deviations."""
FULL_THRUST: Final = 0.2
"""Length of the arrow of full thrust, in widths of its view."""

# Okabe and Ito's colours, told apart by colour-blind readers.
BLACK, ORANGE, GREEN, BLUE, RED, PURPLE = "#000000", "#E69F00", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
GREY: Final = "#666666"

STYLES: Final[dict[str, dict[str, Any]]] = {
    "leader": {"color": BLACK, "marker": "s", "ls": "", "ms": 6, "label": "leader"},
    "orbit": {"color": ORANGE, "lw": 1.2, "label": "reference path"},
    "tolerance": {"color": ORANGE, "lw": 0.9, "ls": ":"},
    "trail": {"color": BLUE, "lw": 1.6, "label": "trail"},
    "lost": {"color": RED, "lw": 2.2, "label": "trail, link lost"},
    "reference": {"color": ORANGE, "marker": "D", "mec": BLACK, "mew": 0.7, "ls": "", "ms": 7, "label": "reference"},
    "follower": {"color": BLUE, "marker": "o", "ls": "", "ms": 8, "mew": 1.8, "label": "follower"},
    "ellipse": {"color": PURPLE, "lw": 1.4},
    "estimate": {"color": PURPLE, "marker": "x", "ls": "", "ms": 7, "mew": 2, "label": f"estimate, {SIGMAS:g}σ"},
}
"""What is drawn in every view, from back to front."""


class View:
    """One projection of the scene: along-track to the right, radial or cross-track upward."""

    def __init__(self, axes: Axes, up: int, close_up: bool) -> None:
        """Put the artists on axes.

        Args:
            axes: where.
            up: 0 for radial, 2 for cross-track.
            close_up: whether the follower stays in the middle.
        """
        self.axes, self._pick, self._close_up = axes, [1, up], close_up
        self._unit_m = 1.0
        self._lines = {name: axes.plot([], [], **style)[0] for name, style in STYLES.items()}
        arrow = {"scale_units": "width", "scale": 1 / FULL_THRUST, "width": 0.014}
        self._arrow = axes.quiver([0], [0], [0], [0], color=GREEN, minlength=0, zorder=2.5, **arrow)
        self.artists: list[Artist] = [*self._lines.values(), self._arrow]
        axes.set_aspect("equal")
        axes.grid(color="#e4e4e4", lw=0.7)
        axes.set_axisbelow(True)

    def limit(self, centre: Array, half_m: float) -> None:
        """Show what is within half_m of a position (3,), m."""
        kilometres = half_m >= 2000
        self._unit_m = 1000.0 if kilometres else 1.0
        middle, half = centre[self._pick] / self._unit_m, half_m / self._unit_m
        self.axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
        names, unit = {0: "radial x", 1: "along-track y", 2: "cross-track z"}, "km" if kilometres else "m"
        labels = [f"{names[axis]} ({unit})" for axis in self._pick]
        self.axes.set_xlabel(labels[0], labelpad=1)
        self.axes.set_ylabel(labels[1], labelpad=1)

    def show(
        self, moment: Moment, reference: Array, path: Array, trail: Array, lost: Array, tolerance_m: float
    ) -> None:
        """Move the artists.

        Args:
            moment: what to show.
            reference: position (3,), m.
            path: the reference's positions (points, 3), m.
            trail: the follower's positions (points, 3), m.
            lost: whether the measurement was lost at each of them (points,).
            tolerance_m: radius of the circle around the reference, m.
        """
        origin = moment.truth if self._close_up else np.zeros(3)
        circle = _circle() * tolerance_m + reference[self._pick]
        places = {
            "leader": np.zeros((1, 3)),
            "orbit": path,
            "trail": trail,
            "lost": np.where(lost[:, None], trail, np.nan),
            "reference": reference[None],
            "follower": moment.truth[None],
            "estimate": moment.estimate[None],
        }
        flat = {name: points[:, self._pick] for name, points in places.items()}
        flat |= {"tolerance": circle, "ellipse": self._ellipse(moment)}
        for name, points in flat.items():
            self._lines[name].set_data(*((points - origin[self._pick]) / self._unit_m).T)
        for name in ("ellipse", "estimate"):
            self._lines[name].set_visible(self._close_up or not moment.measured)
        self._lines["follower"].set_markerfacecolor(BLUE if moment.measured else "white")
        self._arrow.set_offsets((moment.truth - origin)[self._pick] / self._unit_m)
        self._arrow.set_UVC(*moment.thrust[self._pick])

    def _ellipse(self, moment: Moment) -> Array:
        """Points (points, 2) of the estimate's error ellipse, m."""
        values, vectors = np.linalg.eigh(moment.covariance[np.ix_(self._pick, self._pick)])
        axes = vectors * np.sqrt(np.maximum(values, 0))
        return moment.estimate[self._pick] + SIGMAS * _circle() @ axes.T


def _circle() -> Array:
    """Points (points, 2) of the unit circle."""
    angles = np.linspace(0, 2 * np.pi, 61)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)
