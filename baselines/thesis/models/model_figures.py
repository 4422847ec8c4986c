"""Figures of the linear models' errors, open and closed loop."""

from typing import Any, Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.report.style import NEUTRAL
from baselines.thesis.figures import style
from baselines.thesis.models import closed_loop_costs
from baselines.thesis.models.open_loop_errors import CIRCULAR_ONLY, FORMATIONS, MODELS, SPANS, about, leader

LOOKS: Final[dict[str, dict[str, Any]]] = dict(
    zip(
        MODELS,
        (
            {"color": "#333333", "marker": "o", "lw": 3, "ms": 7},  # the others may cover it
            {"color": "#E69F00", "marker": "s", "lw": 1.6, "ms": 5},
            {"color": "#009E73", "marker": "D", "lw": 1.3, "ms": 4},
            {"color": "#CC79A7", "marker": "^", "lw": 1.3, "ms": 4, "linestyle": "--"},
        ),
        strict=True,
    )
)
"""Line styles of the models; no policy has these colours."""
TRUTHS: Final = {
    closed_loop_costs.LINEAR: ("#333333", "o"),
    closed_loop_costs.OSCULATING: ("#E69F00", "s"),
    closed_loop_costs.MEAN: ("#009E73", "D"),
    closed_loop_costs.ELLIPTIC: ("#CC79A7", "^"),
    closed_loop_costs.CIRCULAR: ("#882255", "v"),
}
WIDE: Final = 10.0
"""Ratio of costs from which their axis is logarithmic."""
SIZE: Final = "Size [m]"
ERROR: Final = "Position error [m]"


def against_size(errors: pd.DataFrame, span: int) -> Figure:
    """Error after some orbits against the formation's size, for the thesis's leader; a panel for each formation."""
    figure, panels = _panels()
    bare = about(errors, leader(j2=False))
    for formation, axes in panels.items():
        _lines(axes, about(errors, leader()), formation, span, "size_m")
        alone = _choose(bare, "HCW", formation, span)
        axes.plot(alone["size_m"], alone["error_m"], color=NEUTRAL, ls=":", lw=2, label="HCW, truth without J2")
        axes.plot(alone["size_m"], 0.01 * alone["size_m"], color=NEUTRAL, lw=0.8, label="1 % of the size")
        axes.set_xscale("log")
        axes.set_yscale("log")
    return _finished(figure, panels, SIZE)


def against_inclination(errors: pd.DataFrame, size_m: float) -> Figure:
    """Error after one orbit and after ten against the inclination of a circular orbit, at one size."""
    base = leader()
    chosen = errors[errors["j2"] & (errors["eccentricity"] == base.eccentricity) & (errors["size_m"] == size_m)]
    figure, panels = _panels()
    for formation, axes in panels.items():
        _both_spans(axes, chosen, formation, "inclination_deg")
        axes.set_yscale("log")
        axes.set_xticks(range(0, 91, 30))
    return _finished(figure, panels, "Inclination [deg]")


def against_eccentricity(errors: pd.DataFrame, size_m: float, j2: bool) -> Figure:
    """Error after one orbit and after ten against the eccentricity, at one size."""
    base = leader()
    tilted = errors["inclination_deg"] == base.inclination_deg
    chosen = errors[tilted & (errors["j2"] == j2) & (errors["size_m"] == size_m)]
    figure, panels = _panels()
    for formation, axes in panels.items():
        _both_spans(axes, chosen, formation, "eccentricity")
        axes.set_xscale("symlog", linthresh=1e-3)
        axes.set_yscale("log")
        axes.set_xticks([0, 1e-3, 1e-2, 1e-1], ["0", "0.001", "0.01", "0.1"])
    _finished(figure, panels, "Eccentricity")
    for formation in CIRCULAR_ONLY:
        panels[formation].set_title(f"{formation} (circular leader only)", fontsize=9)
    return figure


def _panels() -> tuple[Figure, dict[str, Axes]]:
    """Make a sheet with a panel for each formation and room for the legend in the last place."""
    figure = style.sheet(5.6)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    return figure, dict(zip(FORMATIONS, grid.flat, strict=False))


def _finished(figure: Figure, panels: dict[str, Axes], x: str) -> Figure:
    """Label axes and panels, and put the legend in the empty panel."""
    for formation, axes in panels.items():
        axes.set_title(formation, fontsize=9)
        axes.set_xlabel(x)
        axes.xaxis.set_tick_params(labelbottom=True)
    for axes in figure.axes[::3]:
        axes.set_ylabel(ERROR)
    empty = figure.axes[-1]
    empty.set_axis_off()
    handles, labels = panels["space circle"].get_legend_handles_labels()
    empty.legend(handles, labels, loc="center", fontsize=8)
    return figure


def _choose(errors: pd.DataFrame, model: str, formation: str, span: int) -> pd.DataFrame:
    same = (errors["model"] == model) & (errors["formation"] == formation)
    return errors[same & (errors["orbits"] == span)]


def _lines(axes: Axes, errors: pd.DataFrame, formation: str, span: int, over: str, faint: bool = False) -> None:
    """Draw a line for each applicable model; faint lines are not in the legend."""
    for model, look in LOOKS.items():
        chosen = _choose(errors, model, formation, span).sort_values(over)
        weight: dict[str, Any] = {"alpha": 0.55, "mfc": "none"} if faint else {"label": model}
        axes.plot(chosen[over], chosen["error_m"], **look, **weight)


def _both_spans(axes: Axes, errors: pd.DataFrame, formation: str, over: str) -> None:
    """Draw filled marks for ten orbits, hollow and faint ones for one."""
    marks: dict[int, dict[str, Any]] = {SPANS[-1]: {}, SPANS[0]: {"mfc": "none", "alpha": 0.55}}
    for span, mark in marks.items():
        label = f"over {span} {'orbit' if span == 1 else 'orbits'}"
        axes.plot([], [], color="#333333", marker="o", ls="", ms=7, label=label, **mark)
    _lines(axes, errors, formation, SPANS[-1], over)
    _lines(axes, errors, formation, SPANS[0], over, faint=True)


def costs(summary: pd.DataFrame) -> Figure:
    """Costs of each law on each truth, and their increase over the linear one, with 95 % intervals.

    Args:
        summary: of `closed_loop_costs.summary`.
    """
    scenarios = list(summary["scenario"].unique())
    counts = [summary[summary["scenario"] == name]["policy"].nunique() for name in scenarios]
    figure = style.sheet(9.0)
    grid = figure.subplots(len(scenarios), 2, height_ratios=counts, sharey="row")
    for name, (left, right) in zip(scenarios, grid, strict=True):
        lines = summary[summary["scenario"] == name]
        _intervals(left, lines, ("cost_m_s", "low", "high"))
        _intervals(right, lines[lines["truth"] != closed_loop_costs.LINEAR], ("more_m_s", "more_low", "more_high"))
        left.set_title(name, fontsize=9, loc="left")
        if lines["cost_m_s"].max() > WIDE * lines["cost_m_s"].min():
            left.set_xscale("log")
        if name == closed_loop_costs.ECCENTRIC:
            right.set_xscale("symlog", linthresh=1.0)
        right.axvline(0, color=NEUTRAL, lw=0.8)
    style.label(grid[-1, 0], "Cost [m/s]", "")
    style.label(grid[-1, 1], "Increase over the linear truth, paired [m/s]", "")
    drawn = {label: mark for axes in grid[:, 0] for mark, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(drawn.values(), drawn.keys(), loc="outside upper center", ncols=3)
    return figure


def _intervals(axes: Axes, lines: pd.DataFrame, columns: tuple[str, str, str]) -> None:
    """Draw a row for each policy, with a mark and its interval for each truth."""
    policies, truths = list(lines["policy"].unique()), list(lines["truth"].unique())
    for rank, truth in enumerate(truths):
        mine = lines[lines["truth"] == truth].set_index("policy").loc[policies]
        mean, low, high = (mine[column].to_numpy(float) for column in columns)
        places = [index + 0.22 * (rank - (len(truths) - 1) / 2) for index in range(len(policies))]
        color, marker = TRUTHS[truth]
        axes.errorbar(mean, places, xerr=(mean - low, high - mean), color=color, fmt=marker, ms=4, label=truth)
    axes.set_yticks(range(len(policies)), policies)
    axes.set_ylim(len(policies) - 0.5, -0.5)
