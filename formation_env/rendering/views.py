"""A projection of the scene onto axes, and the styles of its parts."""

from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.rendering.moment import Moment

SIGMAS: Final = 3.0
"""Size of the drawn ellipse, in standard deviations."""
FULL_THRUST: Final = 0.2
"""Length of the arrow of full thrust, in widths of its view; the length goes with the square root of the thrust."""
NAMES: Final = ("radial x", "along-track y", "cross-track z")

# Okabe and Ito's colours, told apart by colour-blind readers.
BLACK, ORANGE, GREEN, BLUE, RED, PURPLE = "#000000", "#E69F00", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
GREY: Final = "#666666"

STYLES: Final[dict[str, dict[str, Any]]] = {
    "path": {"color": ORANGE, "lw": 1.2, "label": "reference path"},
    "tolerance": {"color": ORANGE, "lw": 1.0, "ls": ":"},
    "trail": {"color": BLUE, "lw": 1.6, "label": "trail"},
    "lost": {"color": RED, "lw": 2.4, "label": "trail, link lost"},
    "leader": {"color": BLACK, "marker": "s", "ls": "", "ms": 6, "label": "leader"},
    "reference": {"color": ORANGE, "marker": "D", "mec": BLACK, "mew": 0.7, "ls": "", "ms": 7, "label": "reference"},
    "follower": {"color": BLUE, "marker": "o", "ls": "", "ms": 8, "mew": 1.8, "label": "follower"},
    "ellipse": {"color": PURPLE, "lw": 1.4},
    "estimate": {"color": PURPLE, "marker": "x", "ls": "", "ms": 6, "mew": 1.8, "label": f"estimate, {SIGMAS:g}σ"},
}
"""Styles of the lines of every view, from back to front."""
STILL: Final = ("path", "leader")
"""Lines that do not move, except in a close-up."""


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
        self._arrow = axes.quiver(
            [0], [0], [0], [0], color=GREEN, minlength=0, scale_units="width", scale=1 / FULL_THRUST
        )
        self._arrow.width = 0.036 if close_up else 0.015
        still = () if close_up else STILL
        lines = [line for name, line in self._lines.items() if name not in still]
        self.moving: list[Artist] = [self._arrow, *lines]
        if close_up:
            for name in ("reference", "follower", "estimate"):
                self._lines[name].set_markersize(5)
        axes.set_aspect("equal")
        axes.grid(color="#e4e4e4", lw=0.7)
        axes.locator_params(nbins=4 if close_up else 7)
        axes.set_axisbelow(True)

    def prepare(self, centre: Array, half_m: float, path: Array) -> None:
        """Set limits, labels and the reference path of the present phase.

        Args:
            centre: position in the middle (3,), m.
            half_m: half the width, m.
            path: the reference's positions (points, 3), m.
        """
        kilometres = half_m >= 1000
        self._unit_m = 1000.0 if kilometres else 1.0
        middle, half = centre[self._pick] / self._unit_m, half_m / self._unit_m
        self.axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
        right, up = (f"{NAMES[axis]} ({'km' if kilometres else 'm'})" for axis in self._pick)
        self.axes.set_xlabel(right, labelpad=1, fontsize=9)
        self.axes.set_ylabel(up, labelpad=1, fontsize=9)
        self._path = path[:, self._pick]
        self._place({"path": self._path, "leader": np.zeros((1, 2))}, np.zeros(2))

    def show(self, moment: Moment, reference: Array, trail: Array, lost: NDArray[np.bool_], tolerance_m: float) -> None:
        """Move the lines to a moment.

        Args:
            moment: the moment.
            reference: position (3,), m.
            trail: the follower's positions (points, 3), m.
            lost: whether the measurement was lost at each of them (points,).
            tolerance_m: radius of the circle around the reference, m.
        """
        follower, goal, flown = moment.truth[self._pick], reference[self._pick], trail[:, self._pick]
        origin = follower if self._close_up else np.zeros(2)
        points = {
            "tolerance": goal + tolerance_m * _circle(),
            "trail": flown,
            "lost": np.where(lost[:, None], flown, np.nan),
            "reference": goal[None],
            "follower": follower[None],
            "ellipse": self._ellipse(moment),
            "estimate": moment.estimate[None, self._pick],
        }
        if self._close_up:
            points |= {"path": self._path, "leader": np.zeros((1, 2))}
        self._place(points, origin)
        for name in ("ellipse", "estimate"):
            self._lines[name].set_visible(self._close_up or not moment.measured)
        self._lines["follower"].set_markerfacecolor(BLUE if moment.measured else "white")
        self._arrow.set_offsets((follower - origin) / self._unit_m)
        self._arrow.set_UVC(*_arrow_lengths(moment.thrust)[self._pick])

    def _place(self, points: dict[str, Array], origin: Array) -> None:
        """Put lines at points (points, 2), m from the origin (2,)."""
        for name, places in points.items():
            self._lines[name].set_data(*((places - origin) / self._unit_m).T)

    def _ellipse(self, moment: Moment) -> Array:
        """Points (points, 2) of the estimate's error ellipse, m."""
        values, vectors = np.linalg.eigh(moment.covariance[np.ix_(self._pick, self._pick)])
        axes = vectors * np.sqrt(np.maximum(values, 0))
        ellipse: Array = moment.estimate[self._pick] + SIGMAS * _circle() @ axes.T
        return ellipse


def _circle() -> Array:
    """Points (points, 2) of the unit circle."""
    angles = np.linspace(0, 2 * np.pi, 61)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _arrow_lengths(thrust: Array) -> Array:
    """Thrust (3,), full at 1, scaled to the square root of its length, so that small thrusts show."""
    size = float(np.linalg.norm(thrust))
    return thrust / np.sqrt(size) if size > 0 else thrust
