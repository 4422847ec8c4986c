"""Errors, accelerations and estimates over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.thesis.figures import style
from baselines.thesis.recorded_flights import Flights
from formation_env.numerics.arrays import Array
from formation_env.task.schedule import legs

ERROR: Final = "Position error [m]"
ACCEL: Final = "Control acceleration [m/s²]"
TIME: Final = "Time [s]"


@dataclass(frozen=True)
class Line:
    """One flight in a panel: the first seed of a policy.

    Attributes:
        label: in the legend.
        flights: whose.
        policy: index of the policy.
        color: of the line.
        dash: of the line.
    """

    label: str
    flights: Flights
    policy: int
    color: str
    dash: str = "-"


def four_panels(lines: Sequence[Line]) -> Figure:
    """Error and acceleration: along each axis for the first line, magnitudes for all lines."""
    figure = style.sheet(5.6)
    grid = figure.subplots(2, 2)
    first = lines[0]
    time_s, scored = first.flights.time_s, flown(first.flights)
    _vector(grid[0, 0], time_s[scored], first.flights.error_m(first.policy)[scored])
    _vector(grid[1, 0], time_s[1:], np.asarray(first.flights.thrust_m_s2[1:, first.policy, 0], float))
    style.label(grid[0, 0], TIME, ERROR)
    style.label(grid[1, 0], TIME, ACCEL)
    for line in reversed(lines):  # the first one on top
        look = {"color": line.color, "linestyle": line.dash, "label": line.label}
        time_s, scored = line.flights.time_s, flown(line.flights)
        grid[0, 1].plot(time_s[scored], line.flights.position_error_m[scored, line.policy, 0], **look)
        grid[1, 1].plot(time_s[1:], line.flights.accel_max_m_s2[1:, line.policy, 0], **look)
    style.label(grid[0, 1], TIME, "Error magnitude [m]")
    style.label(grid[1, 1], TIME, "Acceleration magnitude [m/s²]")
    for axes in grid[:, 1]:
        axes.set_ylim(bottom=0)
    for axes in grid.flat:
        axes.xaxis.set_major_locator(style.few_ticks())
    _both_legends(figure, grid[0, 0], grid[0, 1])
    return figure


def _both_legends(figure: Figure, vectors: Axes, magnitudes: Axes) -> None:
    """Put axes and lines in one legend above the panels."""
    handles, labels = vectors.get_legend_handles_labels()
    more, names = magnitudes.get_legend_handles_labels()
    handles, labels = [*handles, *reversed(more)], [*labels, *reversed(names)]
    figure.legend(handles, labels, loc="outside upper center", ncols=min(5, len(labels)))


def flown(flights: Flights) -> slice:
    """Instants up to the last arrival if the scenario is a single transfer; else all."""
    last = legs(flights.scenario)[-1]
    brief = last.arrival > last.start and last.end - last.arrival == 1
    return slice(0, len(flights.steps) - brief)


def _vector(axes: Axes, time_s: Array, values: Array) -> None:
    """Plot the components (instants, 3) of a vector over time (instants,), s."""
    for (name, color, dash), component in zip(style.AXES, values.T, strict=True):
        axes.plot(time_s, component, color=color, linestyle=dash, label=f"{name}-axis")


@dataclass(frozen=True)
class TimeSpan:
    """Time span of an enlarged panel, s."""

    start_s: float
    end_s: float


def estimation(flights: Flights, policy: int, windows: Sequence[TimeSpan], color: str) -> Figure:
    """Desired, true, measured and estimated position along each axis, each in a window; no measurement is shaded."""
    figure = style.sheet(6.0)
    for axes, window, axis in zip(figure.subplots(3, 1), windows, range(3), strict=True):
        inside = (flights.time_s >= window.start_s) & (flights.time_s <= window.end_s)
        time_s = flights.time_s[inside]
        desired = flights.desired[inside, axis]
        true, measured, estimate = (
            states[inside, policy, 0, axis] for states in (flights.truth, flights.measurement, flights.estimate)
        )
        for start_s, end_s in outages(flights, time_s):
            axes.axvspan(start_s, end_s, color=style.DESIRED, alpha=0.2, lw=0, label="no measurement")
        axes.plot(time_s, desired, color=style.DESIRED, lw=3, label="desired")
        axes.plot(time_s, true, color=color, label="true position")
        axes.plot(time_s, measured, color=style.START, linestyle="", marker=".", markersize=3, label="measurement")
        axes.plot(time_s, estimate, color="black", linestyle=":", lw=1.8, label="estimation")
        axes.set_xlim(window.start_s, min(window.end_s, flights.time_s[-1]))
        style.label(axes, TIME, f"Position {'xyz'[axis]} [m]")
    style.legend(figure, max(figure.axes, key=lambda axes: len(axes.get_legend_handles_labels()[1])))
    return figure


def outages(flights: Flights, time_s: Array) -> list[tuple[float, float]]:
    """The dropout window within some recorded instants (n,), from its first to the next one with a measurement, s."""
    lost = flights.scenario.dropout.closed(time_s).nonzero()[0]
    return [(time_s[lost[0]], time_s[min(lost[-1] + 1, len(time_s) - 1)])] if len(lost) else []
