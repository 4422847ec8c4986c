"""Figures of a sweep: the trade-off, and panels of the cost against each varied quantity."""

import math
from collections.abc import Callable, Collection, Iterable

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from baselines.experiments.sweep import ABOVE, BOUND
from baselines.experiments.variations import FRONT, VARIATIONS, Variation
from baselines.report import style
from baselines.report.scales import Scale
from baselines.report.style import Look

Looks = dict[str, Look]
_PER_ROW = 2
_PANEL_HEIGHT = 300


def looks_of(policies: Iterable[str]) -> Looks:
    """The report's look of each policy; the bound is grey and dashed."""
    return style.looks(name for name in policies if name != BOUND) | {BOUND: Look(style.NEUTRAL, "circle-open", "dash")}


def trade_off_figure(summary: pd.DataFrame, looks: Looks, aside: Collection[str]) -> go.Figure:
    """Mean delta-v against mean hold error, one line per policy, a dot for each error weight.

    A policy that flies the same at all weights, as a learned one does, is one dot.

    Args:
        summary: of one environment, see `experiments.sweep.summarise`.
        looks: of the policies.
        aside: policies that are hidden at first; the axes fit the others.
    """
    front = summary[summary["quantity"] == FRONT]
    figure = go.Figure()
    figure.update_layout(style.base_layout(460))
    for name, line in front.groupby("policy", sort=False):
        same = line[["delta_v_m_s", "position_error_mean_m"]].nunique().max() == 1
        shown = {"mode": "markers" if same else "lines+markers", "visible": "legendonly" if name in aside else True}
        trace = go.Scatter(x=line["delta_v_m_s"], y=line["position_error_mean_m"], name=name, **shown)
        trace.update(_look(looks[str(name)]), customdata=line[["value", "cost_m_s"]].to_numpy())
        hover = "Δv %{x:.4g} m/s, error %{y:.4g} m<br>weight × %{customdata[0]:g}: cost %{customdata[1]:.4g} m/s"
        figure.add_trace(trace.update(hovertemplate=hover))
    figure.update_xaxes(style.axis("mean Δv, m/s"))
    figure.update_yaxes(style.axis("mean position error in hold, m"))
    for axis, column in (("xaxis", "delta_v_m_s"), ("yaxis", "position_error_mean_m")):
        _fit(figure, axis, front.loc[~front["policy"].isin(aside), column].to_numpy(float))
        if figure.layout[axis].type == "log":
            figure.layout[axis].dtick = "D2"  # labels at 1, 2 and 5: there is room for them
    return figure.update_layout(legend={"orientation": "h", "x": 0, "y": -0.16, "yanchor": "top"})


def robustness_figure(summary: pd.DataFrame, looks: Looks, aside: Collection[str]) -> go.Figure:
    """Mean cost against each quantity, a small panel each.

    Args:
        summary: of one environment, see `experiments.sweep.summarise`.
        looks: of the policies.
        aside: policies that are hidden at first; the axes fit the others.
    """
    return _panels(summary, looks, aside, "cost, m/s", _cost_line, ["cost_m_s"])


def difference_figure(summary: pd.DataFrame, looks: Looks, aside: Collection[str]) -> go.Figure:
    """Cost above the reference policy's on the same seeds, with its 95 % interval, against each quantity.

    Args:
        summary: of one environment, see `experiments.sweep.summarise`.
        looks: of the policies.
        aside: policies that are hidden at first; the axes fit the others.
    """
    reference = str(summary["reference"].iloc[0])
    others = summary[(summary["policy"] != reference) & (summary["policy"] != BOUND)]
    figure = _panels(others, looks, aside, f"cost against {reference}, %", _difference_line, ABOVE)
    for index in range(len(_quantities())):
        number = "" if index == 0 else str(index + 1)
        zero = {"type": "line", "xref": f"x{number} domain", "yref": f"y{number}", "x0": 0, "x1": 1, "y0": 0, "y1": 0}
        figure.add_shape(**zero, layer="below", line={"color": style.NEUTRAL, "width": 1.3})
    return figure


def _quantities() -> list[str]:
    return [name for name in VARIATIONS if name != FRONT]


def _panels(
    summary: pd.DataFrame,
    looks: Looks,
    aside: Collection[str],
    title: str,
    line_of: Callable[[str, pd.DataFrame, Look, int], go.Scatter],
    fitted: list[str],
) -> go.Figure:
    """A panel for each quantity, a line for each policy.

    Args:
        summary: of one environment.
        looks: of the policies.
        aside: policies that are hidden at first.
        title: of the vertical axes.
        line_of: makes a policy's line from its name, lines of the summary, look and place among the policies.
        fitted: columns that the vertical axes hold.
    """
    rows = math.ceil(len(_quantities()) / _PER_ROW)
    figure = make_subplots(rows=rows, cols=_PER_ROW, vertical_spacing=0.30 / rows, horizontal_spacing=0.09)
    figure.update_layout(style.base_layout(rows * _PANEL_HEIGHT))
    for index, quantity in enumerate(_quantities()):
        row, column = divmod(index, _PER_ROW)
        panel = summary[summary["quantity"] == quantity]
        for place, (name, line) in enumerate(panel.groupby("policy", sort=False)):
            trace = line_of(str(name), line, looks[str(name)], place).update(showlegend=index == 0)
            if name in aside:
                trace.visible = "legendonly"
            figure.add_trace(trace, row=row + 1, col=column + 1)
        number = "" if index == 0 else str(index + 1)
        _label(figure, number, VARIATIONS[quantity], panel["value"].unique().tolist(), title)
        near = panel.loc[~panel["policy"].isin(aside), fitted].to_numpy(float)
        if near.size:
            _fit(figure, f"yaxis{number}", near)
    return figure.update_layout(legend={"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom"})


def _cost_line(name: str, line: pd.DataFrame, look: Look, place: int) -> go.Scatter:
    """A policy's mean cost; intervals of costs overlap and say nothing about paired differences."""
    ends = line[["cost_low_m_s", "cost_high_m_s"]].to_numpy()
    trace = go.Scatter(x=line["value"], y=line["cost_m_s"], mode="lines+markers", name=name, legendgroup=name)
    hover = "%{x:g}: %{y:.4g} [%{customdata[0]:.4g}, %{customdata[1]:.4g}] m/s"
    return trace.update(_look(look), customdata=ends, hovertemplate=hover)


def _difference_line(name: str, line: pd.DataFrame, look: Look, place: int) -> go.Scatter:
    """A policy's paired difference with whiskers."""
    mean, low, high = (line[key].to_numpy(float) for key in ABOVE)
    trace = go.Scatter(x=line["value"], y=mean, mode="lines+markers", name=name, legendgroup=name)
    whisker = {"type": "data", "symmetric": False, "array": high - mean, "arrayminus": mean - low, "color": look.color}
    hover = "%{x:g}: %{y:+.3g} [%{customdata[0]:+.3g}, %{customdata[1]:+.3g}] %"
    ends = np.column_stack([low, high])
    return trace.update(
        _look(look), error_y=whisker | {"thickness": 1.2, "width": 3}, customdata=ends, hovertemplate=hover
    )


def _look(look: Look) -> dict[str, dict[str, object]]:
    marker = {"color": look.color, "symbol": look.symbol, "size": 8}
    return {"line": {"color": look.color, "dash": look.dash, "width": 1.8}, "marker": marker}


def _label(figure: go.Figure, number: str, variation: Variation, values: list[float], title: str) -> None:
    """Titles of a panel's axes; the varied values are its ticks."""
    texts = [variation.names.get(value, f"{value:g}") for value in values]
    across = style.axis(variation.label) | {"type": "log" if variation.log else "linear"}
    pad = {"range": [-0.4, len(values) - 0.6]} if variation.names else {}
    figure.layout[f"xaxis{number}"].update(across | {"tickvals": values, "ticktext": texts} | pad)
    figure.layout[f"yaxis{number}"].update(style.axis(title))


def _fit(figure: go.Figure, axis: str, values: np.ndarray) -> None:
    """An axis that holds the values; logarithmic if they span decades."""
    settings = Scale.fit(values).settings(axis)
    figure.update_layout({key.replace(".", "_"): value for key, value in settings.items()})
