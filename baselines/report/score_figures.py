"""Pictures of all episodes: the cost of each, and thrust against error."""

import math
from collections.abc import Iterable

import numpy as np
import plotly.graph_objects as go

from baselines.report import style
from baselines.report.results import Interval, Results, number
from baselines.report.style import Look

Looks = dict[str, Look]


def cost_figure(results: Results, looks: Looks) -> go.Figure:
    """Minus the return of every episode, a row of dots for each policy, with mean and interval."""
    figure = go.Figure()
    rows = results.ranking[::-1]
    for row, name in enumerate(rows):
        costs = -results.flown.episodes[name]["return"].to_numpy()
        dots = style.thinned(len(costs))
        figure.add_trace(_dots(costs[dots], row + _spread(len(dots)), looks[name]))
        figure.data[-1].update(customdata=results.flown.episodes[name]["seed"].to_numpy()[dots], name=name)
        figure.data[-1].update(hovertemplate="%{x:.4g} m/s, seed %{customdata}")
        figure.add_trace(_mean_bar(results.interval(name, "return"), row, name))
    every = np.concatenate([-table["return"].to_numpy() for table in results.flown.episodes.values()])
    log = style.needs_log(every) and every.min() > 0
    figure.update_layout(style.base_layout(360), showlegend=False)
    figure.update_xaxes(style.axis("cost = −return: Δv + weighted mean error, m/s", log))
    ticks = {"tickvals": list(range(len(rows))), "ticktext": rows, "range": [-0.6, len(rows) - 0.4]}
    figure.update_yaxes({"gridcolor": style.GRID, "zeroline": False, "automargin": True} | ticks)
    return figure


def _mean_bar(returns: Interval, row: int, name: str) -> go.Scatter:
    """A bar at the mean cost, with the whisker of its interval; the page's style sheet colours it."""
    mean, low, high = returns
    bar = go.Scatter(x=[-mean], y=[row], mode="markers", marker={"size": 1, "color": style.NEUTRAL}, name=name)
    whisker = {"type": "data", "symmetric": False, "array": [mean - low], "arrayminus": [high - mean]}
    look = {"color": style.NEUTRAL, "thickness": 2}
    bar.update(error_x=whisker | look | {"width": 5}, error_y={"type": "data", "array": [0.4], "width": 0} | look)
    return bar.update(cliponaxis=False, hovertemplate="mean %{x:.4g} m/s")


def _spread(count: int) -> np.ndarray:
    """Offsets of `count` dots about their row: the golden ratio's multiples fill it evenly."""
    return 0.62 * ((np.arange(count) * (math.sqrt(5) - 1) / 2) % 1 - 0.5)


def _dots(x: np.ndarray, y: np.ndarray, look: Look) -> go.Scatter:
    """One small dot per episode."""
    marker = {"color": look.color, "symbol": look.symbol, "size": 6, "opacity": 0.45}
    x, y = x.astype(np.float32), y.astype(np.float32)
    return go.Scatter(x=x, y=y, mode="markers", marker=marker, cliponaxis=False)


def _mean(x: list[float], y: list[float], look: Look, name: str) -> go.Scatter:
    """A large outlined marker."""
    marker = {"color": look.color, "symbol": look.symbol, "size": 13, "line": {"color": style.NEUTRAL, "width": 2}}
    return go.Scatter(x=x, y=y, mode="markers", marker=marker, name=name, cliponaxis=False)


def trade_figure(results: Results, looks: Looks) -> go.Figure:
    """Delta-v against mean error: one dot per episode, the means, and lines of equal cost."""
    episodes = results.flown.episodes
    thrust = np.concatenate([table["delta_v_m_s"].to_numpy() for table in episodes.values()])
    error = np.concatenate([table["position_error_mean_m"].to_numpy() for table in episodes.values()])
    x_scale, y_scale = _Scale(thrust), _Scale(error)
    figure = go.Figure()
    for line in _equal_cost(results, x_scale, y_scale):
        figure.add_trace(line)
    for name in results.ranking:
        table = episodes[name].iloc[style.thinned(len(episodes[name]))]
        values = table[["delta_v_m_s", "position_error_mean_m"]].to_numpy()
        figure.add_trace(_dots(x_scale.place(values[:, 0]), y_scale.place(values[:, 1]), looks[name]))
        hover = "Δv %{customdata[0]:.4g} m/s, error %{customdata[1]:.4g} m, seed %{customdata[2]}"
        custom = np.column_stack([values, table["seed"]])
        figure.data[-1].update(customdata=custom, hovertemplate=hover, name=name, legendgroup=name, showlegend=False)
        means = results.mean(name, "delta_v_m_s"), results.mean(name, "position_error_mean_m")
        x, y = x_scale.place(means[0]), y_scale.place(means[1])
        figure.add_trace(_mean([float(x)], [float(y)], looks[name], name))
        hover = f"mean: Δv {number(means[0])} m/s, error {number(means[1])} m"
        figure.data[-1].update(hovertemplate=hover, legendgroup=name)
    figure.update_layout(style.base_layout(360))
    figure.update_layout(legend={"orientation": "h", "x": 0, "y": -0.22, "yanchor": "top"})
    figure.update_xaxes(style.axis("Δv, m/s", x_scale.log), range=x_scale.axis_range)
    figure.update_yaxes(style.axis("mean position error in hold, m", y_scale.log), range=y_scale.axis_range)
    return figure


class _Scale:
    """A linear or logarithmic axis that fits the values; zeros on a logarithmic one stand at its edge."""

    def __init__(self, values: np.ndarray) -> None:
        positive = values[values > 0]
        self.log = style.needs_log(values)
        if not self.log:
            pad = 0.08 * (np.ptp(values) or 1.0)
            self.edge, self.low, self.high = -math.inf, float(values.min() - pad), float(values.max() + pad)
            return
        self.edge = positive.min() / (2.0 if (values <= 0).any() else 1.0)
        self.low, self.high = float(self.edge / 1.3), float(positive.max() * 1.4)

    @property
    def axis_range(self) -> list[float]:
        """Range as plotly wants it: exponents on a logarithmic axis."""
        return [math.log10(self.low), math.log10(self.high)] if self.log else [self.low, self.high]

    def place(self, values: np.ndarray | float) -> np.ndarray:
        """Where values are drawn."""
        return np.maximum(values, self.edge)

    def grid(self, below: float) -> np.ndarray:
        """Positions from the low edge up to `below` for a smooth line, closer together at its end."""
        top = min(below, self.high)
        low = max(self.low, 1e-9 * top) if self.log else max(self.low, 0.0)
        if top <= low:
            return np.empty(0)
        even = np.geomspace(low, top, 80) if self.log else np.linspace(low, top, 80)
        near = below - np.geomspace(0.2 * below, 1e-6 * below, 60)
        return np.unique(np.concatenate([even, near[(near > low) & (near < top)]]))


def _equal_cost(results: Results, x: _Scale, y: _Scale) -> Iterable[go.Scatter]:
    """Lines of delta-v + weight * mean error = cost; none where the reward is of another form."""
    reward = results.flown.scenario.reward
    if reward.shape != "linear" or reward.transfer_error_weight > 0 or reward.error_weight <= 0:
        return
    corners = (max(x.low, 0) + reward.error_weight * max(y.low, 0), x.high + reward.error_weight * y.high)
    for cost in _round_costs(*corners):
        thrust = x.grid(cost)
        error = (cost - thrust) / reward.error_weight
        inside = (error >= y.low) & (error <= y.high)
        if inside.sum() < 2:
            continue
        thrust, error = thrust[inside].astype(np.float32), error[inside].astype(np.float32)
        label = [f" {cost:g} m/s"] + [""] * (len(thrust) - 1)
        line = go.Scatter(x=thrust, y=error, mode="lines+text", text=label, textposition="top right")
        line.update(line={"color": style.NEUTRAL, "width": 1, "dash": "dot"}, opacity=0.7, showlegend=False)
        line.update(textfont={"size": 11, "color": style.NEUTRAL}, hoverinfo="skip")
        yield line


def _round_costs(low: float, high: float) -> list[float]:
    """At most seven round costs between two."""
    for digits in ((1, 2, 5), (1, 3), (1,)):
        decades = range(math.floor(math.log10(max(low, 1e-6))), math.ceil(math.log10(high)) + 1)
        costs = [digit * 10.0**decade for decade in decades for digit in digits]
        costs = [cost for cost in costs if low < cost < high]
        if len(costs) <= 7:
            return costs
    return costs[-7:]
