"""Accuracy and consumption against each other and against time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure

from baselines.thesis.figures import style
from baselines.thesis.flight_recorder import whole_periods
from baselines.thesis.recorded_flights import Flights
from formation_env.numerics.arrays import Array

PERIODS = "Time [period]"
CONSUMPTION = "Control consumption [m/s]"


@dataclass(frozen=True)
class Course:
    """A policy's accuracy and consumption up to each whole period, means over the seeds.

    Attributes:
        label: in the legend.
        flights: whose.
        policy: index of the policy.
        color: of its lines.
        marker: of its dots.
    """

    label: str
    flights: Flights
    policy: int
    color: str
    marker: str

    @property
    def periods(self) -> list[int]:
        """Whole periods of the flight."""
        return whole_periods(self.flights.scenario)

    def so_far(self, quantity: str) -> Array:
        """`mean_error`, `max_error` or `delta_v` of `Flights` up to each period (periods,)."""
        values = [getattr(self.flights, quantity)(end)[self.policy].mean() for end in self.periods]
        return np.array(values)


def against_transfer_time(flown: Mapping[float, Flights], color: str) -> Figure:
    """Maximum and mean error and control of one policy against the transfer time in periods."""
    figure = style.sheet(5.0)
    errors, controls = figure.subplots(2, 1)
    times = sorted(flown)
    greatest = [flown[time].max_error()[0, 0] for time in times]
    mean = [flown[time].mean_error()[0, 0] for time in times]
    errors.plot(times, greatest, color=color, marker="o", label="max value")
    errors.plot(times, mean, color=color, marker="s", linestyle="--", label="mean value")
    greatest = [flown[time].max_accel()[0, 0] for time in times]
    mean = [flown[time].delta_v()[0, 0] / flown[time].time_s[-1] for time in times]
    controls.plot(times, greatest, color=color, marker="o")
    controls.plot(times, mean, color=color, marker="s", linestyle="--")
    style.label(errors, "Transfer time [period]", "Position error [m]")
    style.label(controls, "Transfer time [period]", "Control acceleration [m/s²]")
    for axes in (errors, controls):
        axes.axvspan(0.2, 0.8, color=style.DESIRED, alpha=0.15, lw=0, label="0.2 to 0.8 periods")
        axes.set_ylim(bottom=0)
    style.legend(figure, errors)
    return figure


def trade(flights: Flights, weights: Sequence[int], periods: Sequence[int]) -> Figure:
    """Consumption against accuracy over keeping times, means over the seeds.

    Args:
        flights: of all.
        weights: indices of the policies; each is a point.
        periods: keeping times.
    """
    figure = style.sheet(4.6)
    axes = figure.subplots()
    shades: Colormap = colormaps["viridis"]
    for index, time in enumerate(periods):
        color, marker = shades(index / len(periods)), "osD^"[index % 4]
        spent = flights.delta_v(time)[weights].mean(axis=1)
        for quantity, dash, word in (("mean_error", "-", "mean"), ("max_error", ":", "max")):
            error = getattr(flights, quantity)(time)[weights].mean(axis=1)
            order = np.argsort(error)
            look: dict[str, Any] = {"color": color, "linestyle": dash, "marker": marker, "markersize": 4}
            axes.plot(error[order], spent[order], **look, label=f"t = {time} p, {word}")
    style.label(axes, "Control accuracy [m]", CONSUMPTION)
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    style.legend(figure, axes)
    return figure


def over_time(courses: Sequence[Course]) -> Figure:
    """Maximum and mean error, and consumption, up to each period."""
    figure = style.sheet(5.4)
    errors, spent = figure.subplots(2, 1)
    for course in courses:
        look: dict[str, Any] = {"color": course.color, "marker": course.marker, "markersize": 4}
        errors.plot(course.periods, course.so_far("max_error"), linestyle=":", **look)
        errors.plot(course.periods, course.so_far("mean_error"), **look)
        spent.plot(course.periods, course.so_far("delta_v"), label=course.label, **look)
    style.label(errors, PERIODS, "Position error [m]")
    style.label(spent, PERIODS, CONSUMPTION)
    errors.set_title("dotted: max value, solid: mean value, up to that time", fontsize=9)
    for axes in (errors, spent):
        axes.set_ylim(bottom=0)
        whole_numbers(axes)
    style.legend(figure, spent)
    return figure


def whole_numbers(axes: Axes) -> None:
    """Put a tick at each whole period."""
    low, high = axes.get_xlim()
    axes.set_xticks(np.arange(np.ceil(low), np.floor(high) + 1))


def in_space(courses: Sequence[Course]) -> Figure:
    """Consumption against accuracy and time, in space as in the thesis, and seen from two sides."""
    figure = style.sheet(8.0)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.7, 1.0))
    space: Any = figure.add_subplot(grid[0, :], projection="3d")
    errors, spent = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    for course in courses:
        consumption = course.so_far("delta_v")
        for quantity, dash, word in (("max_error", ":", "max"), ("mean_error", "-", "mean")):
            look: dict[str, Any] = {"color": course.color, "marker": course.marker, "markersize": 4, "linestyle": dash}
            space.plot(course.periods, course.so_far(quantity), consumption, **look)
            errors.plot(course.periods, course.so_far(quantity), label=f"{course.label}, {word} value", **look)
        spent.plot(course.periods, consumption, color=course.color, marker=course.marker, markersize=4)
    style.label(space, PERIODS, "Control accuracy [m]")
    space.set_zlabel(CONSUMPTION)
    style.label(errors, PERIODS, "Control accuracy [m]")
    style.label(spent, PERIODS, CONSUMPTION)
    space.set_box_aspect((1.2, 1.2, 0.8), zoom=0.9)
    for axes in (errors, spent):
        axes.set_ylim(bottom=0)
        whole_numbers(axes)
    style.legend(figure, errors, columns=2)
    return figure
