"""Relative trajectories in space."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from baselines.thesis.figures import style
from baselines.thesis.recorded_flights import Flights
from formation_env.numerics.arrays import Array
from formation_env.task.schedule import legs

MARGIN: Final = 1.08


def flight_path(flights: Flights, policy: int, color: str) -> Figure:
    """True and desired trajectory of the first seed."""
    figure = style.sheet(5.4)
    axes: Any = figure.add_subplot(projection="3d")
    everything = slice(None)
    _paths(axes, flights, policy, everything, color)
    style.legend(figure, axes, columns=5)
    return figure


def phase_paths(flights: Flights, policy: int, pieces: list[tuple[str, float, float]], color: str) -> Figure:
    """True and desired trajectory of the first seed, piece by piece.

    Args:
        flights: whose first seed is drawn.
        policy: index of the policy.
        pieces: title, begin and end of each, in periods of the orbit.
        color: of the true trajectory.
    """
    figure = style.sheet(8.0)
    period_s = flights.scenario.orbit.period_s
    for place, (title, start, end) in enumerate(pieces, 1):
        axes: Any = figure.add_subplot(2, 2, place, projection="3d")
        first, last = np.searchsorted(flights.time_s, [start * period_s + 1e-6, end * period_s + 1e-6])
        _paths(axes, flights, policy, slice(max(first, 1) if start else 0, last), color)
        axes.set_title(title)
    style.legend(figure, axes, columns=5)
    return figure


def _paths(axes: Any, flights: Flights, policy: int, piece: slice, color: str) -> None:
    """Plot a piece of a flight, its true and desired start, and the leader."""
    true, desired = flights.truth[piece, policy, 0, :3], flights.desired[piece, :3]
    jumps = np.searchsorted(flights.steps[piece], [leg.start + 1 for leg in legs(flights.scenario)[1:]])
    axes.plot(*np.insert(desired, jumps, np.nan, axis=0).T, color=style.DESIRED, lw=2.6, label="desired trajectory")
    axes.plot(*true.T, color=color, lw=1.2, label="true trajectory")
    point(axes, true[0], "o", color, "follower's start")
    point(axes, desired[0], "s", style.DESIRED, "desired start")
    point(axes, np.zeros(3), "*", "black", "leader")
    scales(axes, np.vstack([true, desired, np.zeros(3)]))


def point(axes: Any, place: Array, marker: str, color: str, label: str) -> None:
    """Plot one position."""
    axes.plot(*place[:, None], linestyle="none", marker=marker, color=color, markersize=6, label=label)


def scales(axes: Any, points: Array) -> None:
    """Scale each axis, in metres, to points (n, 3) independently."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2 * MARGIN, 0.05 * (high - low).max() or 1.0)
    for name, centre, width in zip("xyz", middle, half, strict=True):
        getattr(axes, f"set_{name}lim")(centre - width, centre + width)
        getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=8)
        getattr(axes, f"{name}axis").set_major_locator(style.few_ticks())
    axes.set_box_aspect((1.0, 1.2, 0.8), zoom=0.78)
