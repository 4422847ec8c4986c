"""Figures of all episodes: the cost of each, and thrust against error."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from baselines.experiments.estimates import Interval
from baselines.experiments.statistics import Results
from baselines.report import style
from baselines.report.scales import Scale, round_values, view_buttons, without_zeros
from baselines.report.style import Look
from baselines.report.text import number
from formation_env.task.reward import Reward

Looks = dict[str, Look]
_HEIGHT = 400
_VIEWS = ["close-up", "all policies"]


def cost_figure(results: Results, looks: Looks) -> go.Figure:
    """Minus the return of every episode, a row of dots for each policy, with mean and interval."""
    figure = go.Figure()
    figure.update_layout(style.base_layout(_HEIGHT), showlegend=False)
    rows = results.ranking[::-1]
    costs = {name: -results.flown.episodes[name]["return"].to_numpy() for name in rows}
    for row, name in enumerate(rows):
        dots = style.thinned(len(costs[name]))
        figure.add_trace(_dots(costs[name][dots], row + _spread(len(dots)), looks[name]))
        seeds = results.flown.episodes[name]["seed"].to_numpy()[dots]
        figure.data[-1].update(customdata=seeds, hovertemplate="%{x:.4g} m/s, seed %{customdata}", name=name)
        figure.add_trace(_mean_bar(results.cost_flown(name), row, name))
    figure.update_xaxes(style.axis("cost = −return: Δv + weighted mean error, m/s"))
    figure.update_yaxes(style.axis(""), tickvals=list(range(len(rows))), ticktext=rows)
    scales = _views([costs[name] for name in rows], [costs[name] for name in rows if name not in results.hidden])
    first = {"yaxis.range": [len(results.hidden) - 0.6, len(rows) - 0.4]}, {"yaxis.range": [-0.6, len(rows) - 0.4]}
    _apply(figure, [scale.settings("xaxis") | ends for scale, ends in zip(scales, first, strict=False)])
    return figure


def _views(every: list[np.ndarray], near: list[np.ndarray]) -> list[Scale]:
    """The close-up of the near ones and the view of all, or only this if they are the same."""
    scales = [Scale.fit(np.concatenate(near)), Scale.fit(np.concatenate(every))]
    return scales if len(near) < len(every) else scales[:1]


def _apply(figure: go.Figure, layouts: list[dict[str, Any]], traces: list[dict[str, Any]] | None = None) -> None:
    """Show the first view, and make buttons if there are two."""
    figure.update_layout({key.replace(".", "_"): value for key, value in layouts[0].items()})
    if len(layouts) > 1:
        traces = traces or [{}, {}]
        figure.update_layout(
            updatemenus=[view_buttons(_VIEWS, [list(pair) for pair in zip(traces, layouts, strict=True)])]
        )
        figure.update_layout(margin_t=48)


def _mean_bar(cost: Interval, row: int, name: str) -> go.Scatter:
    """A bar at the mean cost, with the whisker of its interval; the page's style sheet colours it."""
    mean, low, high = cost
    bar = go.Scatter(x=[mean], y=[row], mode="markers", marker={"size": 1, "color": style.NEUTRAL}, name=name)
    whisker = {"type": "data", "symmetric": False, "array": [high - mean], "arrayminus": [mean - low]}
    look = {"color": style.NEUTRAL, "thickness": 2}
    bar.update(error_x=whisker | look | {"width": 5}, error_y={"type": "data", "array": [0.4], "width": 0} | look)
    return bar.update(hovertemplate="mean %{x:.4g} m/s")


def _spread(count: int) -> np.ndarray:
    """Offsets of `count` dots about their row: the golden ratio's multiples fill it evenly."""
    return 0.62 * ((np.arange(count) * (math.sqrt(5) - 1) / 2) % 1 - 0.5)


def _dots(x: np.ndarray, y: np.ndarray, look: Look) -> go.Scatter:
    """One small dot per episode."""
    marker = {"color": look.color, "symbol": look.symbol, "size": 6, "opacity": 0.45}
    return go.Scatter(x=x.astype(np.float32), y=y.astype(np.float32), mode="markers", marker=marker)


def trade_figure(results: Results, looks: Looks) -> go.Figure:
    """Delta-v against mean error: one dot per episode, the means, and lines of equal cost."""
    figure = go.Figure()
    figure.update_layout(style.base_layout(_HEIGHT))
    tables = results.flown.episodes
    x, y = _placed(results, "delta_v_m_s"), _placed(results, "position_error_mean_m")
    for name in results.ranking:
        shown = style.thinned(len(tables[name]))
        figure.add_trace(_dots(x[name][shown], y[name][shown], looks[name]))
        custom = tables[name][["delta_v_m_s", "position_error_mean_m", "seed"]].to_numpy()[shown]
        hover = "Δv %{customdata[0]:.4g} m/s, error %{customdata[1]:.4g} m, seed %{customdata[2]}"
        figure.data[-1].update(customdata=custom, hovertemplate=hover, name=name, legendgroup=name, showlegend=False)
        means = [float(tables[name][metric].mean()) for metric in ("delta_v_m_s", "position_error_mean_m")]
        place_x, place_y = (mean or float(on[name].mean()) for mean, on in zip(means, (x, y), strict=True))
        figure.add_trace(_mean_dot(place_x, place_y, looks[name], name))
        figure.data[-1].update(hovertemplate=f"mean: Δv {number(means[0])} m/s, error {number(means[1])} m")
    figure.update_layout(legend={"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"})
    figure.update_xaxes(style.axis("Δv, m/s"))
    figure.update_yaxes(style.axis("mean position error in hold, m"))
    _add_views(figure, results, x, y)
    return figure


def _placed(results: Results, metric: str) -> dict[str, np.ndarray]:
    """Coordinates of the episodes of each policy on an axis."""
    values = pd.concat({name: table[metric] for name, table in results.flown.episodes.items()})
    placed = pd.Series(without_zeros(values.to_numpy(float)), values.index)
    return {name: placed.loc[name].to_numpy() for name in results.flown.episodes}


def _mean_dot(x: float, y: float, look: Look, name: str) -> go.Scatter:
    """A large outlined marker."""
    marker = {"color": look.color, "symbol": look.symbol, "size": 13, "line": {"color": style.NEUTRAL, "width": 2}}
    return go.Scatter(x=[x], y=[y], mode="markers", marker=marker, name=name, legendgroup=name)


def _add_views(figure: go.Figure, results: Results, x: dict[str, np.ndarray], y: dict[str, np.ndarray]) -> None:
    """Axes and lines of equal cost, for the close-up and for all."""
    near = [name for name in results.ranking if name not in results.hidden]
    x_scales = _views(list(x.values()), [x[name] for name in near])
    y_scales = _views(list(y.values()), [y[name] for name in near])
    count, belongs = len(figure.data), []
    for view, (x_scale, y_scale) in enumerate(zip(x_scales, y_scales, strict=True)):
        for line in equal_cost_lines(results.flown.scenario.reward, x_scale, y_scale):
            figure.add_trace(line.update(visible=view == 0))
            belongs.append(view)
    shown = [{"visible": [True] * count + [view == which for which in belongs]} for view in range(len(x_scales))]
    layouts = [a.settings("xaxis") | b.settings("yaxis") for a, b in zip(x_scales, y_scales, strict=True)]
    _apply(figure, layouts, shown)


def equal_cost_lines(reward: Reward, x: Scale, y: Scale) -> Iterable[go.Scatter]:
    """Lines of delta-v + weight * mean error = cost; none where the reward is of another form."""
    weight = reward.mean_error_weight()
    if not weight:
        return
    for cost in round_values(max(x.low, 0) + weight * max(y.low, 0), x.high + weight * y.high):
        thrust = x.grid(cost)
        error = (cost - thrust) / weight
        inside = (error >= y.low) & (error <= y.high)
        if inside.sum() < 2:
            continue
        thrust, error = thrust[inside].astype(np.float32), error[inside].astype(np.float32)
        text = [""] * len(thrust)
        text[-1 if cost < x.high else 0] = f"{cost:g} m/s"  # where the line leaves the frame below, or at its start
        line = go.Scatter(x=thrust, y=error, mode="lines+text", text=text, textposition="top right")
        line.update(line={"color": style.NEUTRAL, "width": 1, "dash": "dot"}, showlegend=False, hoverinfo="skip")
        yield line.update(textfont={"size": 11, "color": style.NEUTRAL})
