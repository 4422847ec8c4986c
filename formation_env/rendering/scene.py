"""The whole picture: two views of the formation, two close-ups of the follower, and what there is to say about them."""

from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from formation_env.dynamics.base import Array
from formation_env.rendering.moment import Moment, Plan
from formation_env.rendering.views import GREEN, GREY, RED, STYLES, View
from formation_env.scenario import Scenario

Frame = NDArray[np.uint8]

WIDTH_PX: Final = 960
HEIGHT_PX: Final = 540
DPI: Final = 100
CLOSE_UP_TOLERANCES: Final = 4.0
"""Half a close-up's width, in tolerances of the scenario."""

# Place of each view, px from the lower left: left, bottom, size; what points upward; whether it is a close-up; title.
_VIEWS: Final = (
    (62, 92, 322, 0, False, "Orbit plane, from the side"),
    (446, 92, 322, 2, False, "Local horizontal, from above"),
    (826, 278, 128, 0, True, "Follower, close up"),
    (826, 92, 128, 2, True, ""),
)


class Scene:
    """The picture of a scenario, drawn again and again.

    Axes, grids and legend are drawn once and kept; a frame puts what moves on top of them.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._plan = Plan(scenario)
        self._figure = Figure(figsize=(WIDTH_PX / DPI, HEIGHT_PX / DPI), dpi=DPI, facecolor="white")
        self._canvas = FigureCanvasAgg(self._figure)
        self._views = [View(self._axes(*place), up, close_up) for *place, up, close_up, _ in _VIEWS]
        for view, (*_, title) in zip(self._views, _VIEWS, strict=True):
            view.axes.set_title(title, fontsize=9, color=GREY, pad=4)
        self._clock = self._text(18, 490, 11)
        self._numbers = self._text(18, 464, 11, family="DejaVu Sans Mono", weight="bold")
        self._link = self._text(WIDTH_PX - 18, 516, 11, ha="right", weight="bold")
        self._border = Rectangle((0, 0), 1, 1, transform=self._figure.transFigure, fill=False, ec=RED, lw=7)
        self._figure.add_artist(self._border)
        self._moving: list[Artist] = [self._clock, self._numbers, self._link, self._border]
        self._moving += [artist for view in self._views for artist in view.artists]
        for artist in self._moving:
            artist.set_animated(True)
        self._text(18, 518, 13, weight="bold").set_text(scenario.title)
        self._legend()
        self.restart()

    def _axes(self, left: float, bottom: float, size: float) -> Axes:
        axes = self._figure.add_axes(
            (left / WIDTH_PX, bottom / HEIGHT_PX, size / WIDTH_PX, size / HEIGHT_PX), label=f"{left} {bottom}"
        )
        axes.tick_params(labelsize=8)
        axes.xaxis.label.set_size(9)
        axes.yaxis.label.set_size(9)
        return axes

    def _text(
        self, x: float, y: float, size: float, ha: str = "left", weight: str = "normal", family: str = "DejaVu Sans"
    ) -> Text:
        return self._figure.text(
            x / WIDTH_PX, y / HEIGHT_PX, "", fontsize=size, ha=ha, va="center", fontweight=weight, family=family
        )

    def _legend(self) -> None:
        """One line below the views."""
        full_mm_s2 = 1000 * self._scenario.spacecraft.max_accel_m_s2
        thrust = {
            "color": GREEN,
            "marker": r"$\rightarrow$",
            "ls": "",
            "ms": 13,
            "label": f"thrust ≤ {full_mm_s2:g} mm/s²",
        }
        lines = [Line2D([], [], **style) for style in (*STYLES.values(), thrust) if "label" in style]
        self._figure.legend(
            handles=lines, loc="lower center", ncols=len(lines), frameon=False, fontsize=8.5, borderaxespad=0.4,
            handletextpad=0.4, columnspacing=1.3, handlelength=1.4,
        )  # fmt: skip

    def restart(self) -> None:
        """Show the whole plan again."""
        self._half_m = self._plan.half_m
        self._draw_background()

    def _draw_background(self) -> None:
        close_up_m = CLOSE_UP_TOLERANCES * self._scenario.tolerance_m
        for view, (_, _, _, _, close_up, _) in zip(self._views, _VIEWS, strict=True):
            view.limit(*((np.zeros(3), close_up_m) if close_up else (self._plan.centre, self._half_m)))
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)

    def draw(self, moment: Moment, trail: Array, lost: NDArray[np.bool_]) -> Frame:
        """The picture of a moment.

        Args:
            moment: what to show.
            trail: the follower's positions (points, 3), m.
            lost: whether the measurement was lost at each of them (points,).

        Returns:
            Image (HEIGHT_PX, WIDTH_PX, 3).
        """
        self._zoom_out(moment.truth)
        reference, path = self._plan.reference(moment.step), self._plan.path(moment.step)
        for view in self._views:
            view.show(moment, reference, path, trail, lost, self._scenario.tolerance_m)
        self._clock.set_text(self._clock_line(moment))
        self._numbers.set_text(_numbers_line(moment))
        self._show_link(moment)
        self._canvas.restore_region(self._background)
        for artist in self._moving:
            self._figure.draw_artist(artist)
        return np.array(self._canvas.buffer_rgba())[..., :3].copy()

    def _zoom_out(self, position: Array) -> None:
        """Double the views until the follower is inside."""
        distance_m = float(np.abs(position - self._plan.centre).max())
        if distance_m > self._half_m:
            self._half_m *= 2.0 ** np.ceil(np.log2(distance_m / self._half_m))
            self._draw_background()

    def _clock_line(self, moment: Moment) -> str:
        leg, dt_s, period_s = self._plan.leg(moment.step), self._scenario.dt_s, self._scenario.orbit.period_s
        on_the_way = moment.step < leg.arrival
        left_s = ((leg.arrival if on_the_way else leg.end) - moment.step) * dt_s
        doing, ending = ("transfer to", "to arrival") if on_the_way else ("hold", "left")
        time_s = moment.step * dt_s
        return (
            f"t = {time_s:.0f} s ({time_s / period_s:.2f} orbits)   phase {leg.index + 1} of {len(self._plan.legs)}: "
            f"{doing} {leg.phase.formation.kind.replace('_', ' ')}, {left_s:.0f} s {ending}"
        )

    def _show_link(self, moment: Moment) -> None:
        self._border.set_visible(not moment.measured)
        if moment.measured:
            self._link.set(text="link up", color=GREY, bbox={"fc": "none", "ec": GREY, "boxstyle": "round,pad=0.4"})
        else:
            box = {"fc": RED, "ec": RED, "boxstyle": "round,pad=0.4"}
            self._link.set(text=f"LINK LOST  {moment.age_s:.0f} s", color="white", bbox=box)


def _numbers_line(moment: Moment) -> str:
    sigma_m = float(np.sqrt(np.trace(moment.covariance) / 3))
    return (
        f"position error {moment.position_error_m:8.1f} m   filter 1σ {sigma_m:6.1f} m   "
        f"Δv used {moment.delta_v_m_s:7.3f} m/s"
    )
