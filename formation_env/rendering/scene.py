"""The whole picture: two views of the formation, two close-ups of the follower, and the numbers above them."""

from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.rendering.moment import Moment, Plan
from formation_env.rendering.views import GREEN, GREY, RED, STYLES, View
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg

Frame = NDArray[np.uint8]

WIDTH_PX: Final = 960
HEIGHT_PX: Final = 540
DPI: Final = 100
CLOSE_UP_TOLERANCES: Final = 1.25
"""Half a close-up's width, in tolerances of the scenario."""
TITLE_CHARACTERS: Final = 80
"""Longer titles are printed smaller."""

# Place of each view, px from the lower left: left, bottom, size; what points upward; whether it is a close-up; title.
_VIEWS: Final = (
    (66, 92, 318, 0, False, "Orbit plane, from the side"),
    (448, 92, 318, 2, False, "Local horizontal, from above"),
    (828, 286, 116, 0, True, "Follower, close up"),
    (828, 106, 116, 2, True, ""),
)
# Place of each number, px from the left, and its heading.
_NUMBERS: Final = (
    (18, "time"),
    (96, "orbits"),
    (430, "time left"),
    (514, "position error"),
    (616, "filter 1σ"),
    (698, "thrust"),
    (818, "Δv used"),
)
_PHASE_LEFT_PX: Final = 152


class Scene:
    """The picture of a scenario, redrawn for each frame.

    Axes, grids, headings and the reference path are drawn once per phase and kept; a frame puts what moves on top.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._plan = Plan(scenario)
        self._figure = Figure(figsize=(WIDTH_PX / DPI, HEIGHT_PX / DPI), dpi=DPI, facecolor="white")
        self._canvas: Any = FigureCanvasAgg(self._figure)
        self._views = [View(self._axes(*place), up, close_up) for *place, up, close_up, _ in _VIEWS]
        self._numbers = [self._number(left, heading) for left, heading in _NUMBERS]
        self._phase = self._number(_PHASE_LEFT_PX, "phase")
        self._link = self._text(WIDTH_PX - 90, 439, 10.5, ha="center", weight="bold")
        self._border = Rectangle((0, 0), 1, 1, transform=self._figure.transFigure, fill=False, ec=RED, lw=8)
        self._figure.add_artist(self._border)
        self._moving: list[Artist] = [artist for view in self._views for artist in view.moving]
        self._moving += [*self._numbers, self._border, self._link]
        for artist in self._moving:
            artist.set_animated(True)
        self._write_titles()
        self.restart()

    def _axes(self, left: float, bottom: float, size: float) -> Axes:
        rectangle = (left / WIDTH_PX, bottom / HEIGHT_PX, size / WIDTH_PX, size / HEIGHT_PX)
        axes = self._figure.add_axes(rectangle)
        axes.tick_params(labelsize=8)
        return axes

    def _text(self, x: float, y: float, size: float, text: str = "", ha: str = "left", weight: str = "normal") -> Text:
        place = (x / WIDTH_PX, y / HEIGHT_PX)
        return self._figure.text(*place, text, fontsize=size, ha=ha, va="center", fontweight=weight, parse_math=False)

    def _number(self, left: float, heading: str) -> Text:
        self._text(left, 486, 8.5, heading).set_color(GREY)
        return self._text(left, 466, 10.5, weight="bold")

    def _write_titles(self) -> None:
        """Write the titles of scenario and views, and the legend below the views."""
        title = self._scenario.title
        self._text(18, 518, 13 * min(1, TITLE_CHARACTERS / max(len(title), 1)), title, weight="bold")
        for view, (*_, name) in zip(self._views, _VIEWS, strict=True):
            view.axes.set_title(name, fontsize=9, color=GREY, pad=4)
        full_mm_s2 = 1000 * self._scenario.spacecraft.max_accel_m_s2
        label = f"thrust (√ scale, ≤ {full_mm_s2:.4g} mm/s² per axis)"
        thrust = {"color": GREEN, "marker": r"$\rightarrow$", "ls": "", "ms": 13, "label": label}
        lines = [Line2D([], [], **style) for style in (*STYLES.values(), thrust) if "label" in style]
        spacing = {"handletextpad": 0.4, "columnspacing": 1.1, "handlelength": 1.4, "borderaxespad": 0.5}
        self._figure.legend(
            handles=lines, loc="lower center", ncols=len(lines), frameon=False, fontsize=8.5, **spacing
        )  # fmt: skip

    def restart(self) -> None:
        """Show the whole plan again, from its first phase."""
        self._half_m = self._plan.half_m
        self._draw_background(0)

    def _draw_background(self, step: int) -> None:
        leg = self._plan.leg(step)
        self._shown = _stage(leg, step)
        doing = "transfer to" if step < leg.arrival else "hold"
        formation = leg.phase.formation.kind.replace("_", " ")
        self._phase.set_text(f"{leg.index + 1}/{len(self._plan.legs)}: {doing} {formation}")
        close_up_m = CLOSE_UP_TOLERANCES * self._scenario.tolerance_m
        for view, (*_, close_up, _) in zip(self._views, _VIEWS, strict=True):
            centre, half_m = (np.zeros(3), close_up_m) if close_up else (self._plan.centre, self._half_m)
            view.prepare(centre, half_m, self._plan.paths[leg.index])
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)

    def draw(self, moment: Moment, trail: Array, lost: NDArray[np.bool_]) -> Frame:
        """Draw a moment.

        Args:
            moment: the moment.
            trail: the follower's positions (points, 3), m.
            lost: whether the measurement was lost at each of them (points,).

        Returns:
            Image (HEIGHT_PX, WIDTH_PX, 3).
        """
        self._keep_up(moment)
        reference = self._plan.reference(moment.step)
        for view in self._views:
            view.show(moment, reference, trail, lost, self._scenario.tolerance_m)
        for text, number in zip(self._numbers, self._values(moment), strict=True):
            text.set_text(number)
        self._show_link(moment)
        self._canvas.restore_region(self._background)
        for artist in self._moving:
            self._figure.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _keep_up(self, moment: Moment) -> None:
        """Draw a new background for a new phase, or views of twice the width if the follower has left them."""
        distance_m = float(np.abs(moment.truth - self._plan.centre).max())
        doublings = np.ceil(np.log2(max(distance_m / self._half_m, 1.0)))
        if doublings > 0 or self._shown != _stage(self._plan.leg(moment.step), moment.step):
            self._half_m *= 2.0**doublings
            self._draw_background(moment.step)

    def _values(self, moment: Moment) -> list[str]:
        """Texts of `_NUMBERS`, in their order."""
        dt_s, period_s = self._scenario.dt_s, self._scenario.orbit.period_s
        leg = self._plan.leg(moment.step)
        goal = leg.arrival if moment.step < leg.arrival else leg.end
        sigma_m = float(np.sqrt(np.trace(moment.covariance) / 3))
        accel_mm_s2 = 1000 * self._scenario.spacecraft.max_accel_m_s2 * float(np.linalg.norm(moment.thrust))
        return [
            f"{moment.step * dt_s:.0f} s",
            f"{moment.step * dt_s / period_s:.2f}",
            f"{(goal - moment.step) * dt_s:.0f} s",
            f"{_readable(moment.position_error_m, 1)} m",
            f"{_readable(sigma_m, 1)} m",
            f"{_readable(accel_mm_s2, 2)} mm/s²",
            f"{_readable(moment.delta_v_m_s, 3)} m/s",
        ]

    def _show_link(self, moment: Moment) -> None:
        """Show the link's badge, and a red frame while measurements are lost."""
        self._border.set_visible(not moment.measured)
        text = "LINK UP" if moment.measured else f"LINK LOST  {moment.age_s:.0f} s"
        fill, edge, color = ("white", GREY, GREY) if moment.measured else (RED, RED, "white")
        self._link.set(text=text, color=color, bbox={"fc": fill, "ec": edge, "boxstyle": "round,pad=0.4"})


def _readable(value: float, decimals: int) -> str:
    """A number with some decimals, or two significant digits where these would show fewer."""
    return f"{value:.{decimals}f}" if value == 0 or abs(value) >= 10.0 ** (1 - decimals) else f"{value:.2g}"


def _stage(leg: Leg, step: int) -> tuple[int, bool]:
    """Index of the phase, and whether the follower is in its transfer."""
    return leg.index, step < leg.arrival
