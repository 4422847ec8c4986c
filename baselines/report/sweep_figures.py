"""Pictures of a sweep: the front, and a sheet of what each quantity does to the cost."""

import math
from collections.abc import Collection, Iterable

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.colors import hex_to_rgb
from plotly.subplots import make_subplots

from baselines.experiments.sweep import BOUND
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


def front_figure(summary: pd.DataFrame, looks: Looks, aside: Collection[str]) -> go.Figure:
    """Mean delta-v against mean hold error, one line per policy, a dot for each price of errors.

    A policy that flies the same at all prices, as a learned one does, is one dot.

    Args:
        summary: of one environment, see `flights.summarise`.
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
        hover = "Δv %{x:.4g} m/s, error %{y:.4g} m<br>price × %{customdata[0]:g}: cost %{customdata[1]:.4g} m/s"
        figure.add_trace(trace.update(hovertemplate=hover))
    figure.update_xaxes(style.axis("mean Δv, m/s"))
    figure.update_yaxes(style.axis("mean position error in hold, m"))
    for axis, column in (("xaxis", "delta_v_m_s"), ("yaxis", "position_error_mean_m")):
        _fit(figure, axis, front.loc[~front["policy"].isin(aside), column].to_numpy(float))
        if figure.layout[axis].type == "log":
            figure.layout[axis].dtick = "D2"  # labels at 1, 2 and 5: there is room for them
    return figure.update_layout(legend={"orientation": "h", "x": 0, "y": -0.16, "yanchor": "top"})


def robustness_figure(summary: pd.DataFrame, looks: Looks, aside: Collection[str]) -> go.Figure:
    """Mean cost with its interval against each quantity, a small panel each.

    Args:
        summary: of one environment, see `flights.summarise`.
        looks: of the policies.
        aside: policies that are hidden at first; the axes fit the others.
    """
    quantities = [name for name in VARIATIONS if name != FRONT]
    rows = math.ceil(len(quantities) / _PER_ROW)
    figure = make_subplots(rows=rows, cols=_PER_ROW, vertical_spacing=0.30 / rows, horizontal_spacing=0.09)
    figure.update_layout(style.base_layout(rows * _PANEL_HEIGHT))
    for index, quantity in enumerate(quantities):
        row, column = divmod(index, _PER_ROW)
        panel = summary[summary["quantity"] == quantity]
        for name, line in panel.groupby("policy", sort=False):
            trace = _cost_line(str(name), line, looks[str(name)]).update(showlegend=index == 0)
            band = _band(str(name), line, looks[str(name)])
            if name in aside:
                trace.visible = band.visible = "legendonly"
            figure.add_traces([band, trace], rows=row + 1, cols=column + 1)
        number = "" if index == 0 else str(index + 1)
        _label(figure, number, VARIATIONS[quantity], panel["value"].unique().tolist())
        near = panel[~panel["policy"].isin(aside)]
        _fit(figure, f"yaxis{number}", near[["cost_low_m_s", "cost_high_m_s"]].to_numpy(float))
    return figure.update_layout(legend={"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom"})


def _cost_line(name: str, line: pd.DataFrame, look: Look) -> go.Scatter:
    """A policy's mean cost."""
    ends = line[["cost_low_m_s", "cost_high_m_s"]].to_numpy()
    trace = go.Scatter(x=line["value"], y=line["cost_m_s"], mode="lines+markers", name=name, legendgroup=name)
    hover = "%{x:g}: %{y:.4g} [%{customdata[0]:.4g}, %{customdata[1]:.4g}] m/s"
    return trace.update(_look(look), customdata=ends, hovertemplate=hover)


def _band(name: str, line: pd.DataFrame, look: Look) -> go.Scatter:
    """The interval of a policy's cost, shaded; whiskers of several policies would hide each other."""
    back = line.iloc[::-1]
    x, y = pd.concat([line["value"], back["value"]]), pd.concat([line["cost_high_m_s"], back["cost_low_m_s"]])
    shade = f"rgba{(*hex_to_rgb(look.color), 0.2)}"
    band = go.Scatter(x=x, y=y, fill="toself", fillcolor=shade, mode="lines", line={"width": 0}, legendgroup=name)
    return band.update(hoverinfo="skip", showlegend=False)


def _look(look: Look) -> dict[str, dict[str, object]]:
    marker = {"color": look.color, "symbol": look.symbol, "size": 8}
    return {"line": {"color": look.color, "dash": look.dash, "width": 1.8}, "marker": marker}


def _label(figure: go.Figure, number: str, variation: Variation, values: list[float]) -> None:
    """Titles of a panel's axes; the varied values are its ticks."""
    texts = [variation.names.get(value, f"{value:g}") for value in values]
    across = style.axis(variation.label) | {"type": "log" if variation.log else "linear"}
    pad = {"range": [-0.4, len(values) - 0.6]} if variation.names else {}
    figure.layout[f"xaxis{number}"].update(across | {"tickvals": values, "ticktext": texts} | pad)
    figure.layout[f"yaxis{number}"].update(style.axis("cost, m/s"))


def _fit(figure: go.Figure, axis: str, values: np.ndarray) -> None:
    """An axis that holds the values; logarithmic if they span decades."""
    settings = Scale.fit(values).settings(axis)
    figure.update_layout({key.replace(".", "_"): value for key, value in settings.items()})
