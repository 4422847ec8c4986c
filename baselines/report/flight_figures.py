"""Figures of one episode per policy over time: error, thrust, delta-v, with outages and phases."""

from collections.abc import Iterable

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from baselines.experiments.statistics import Results
from baselines.report import style
from baselines.report.score_figures import Looks
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import legs

ROWS = ("error, m", "thrust, mm/s²", "cumulative Δv, m/s")
RESOLVED_BANDS = 600
"""Bands across a figure that a screen can tell apart."""
THRUST_FLOOR = 1e-4
"""Thrust below this share of the limit is drawn as none: a solver leaves 1e-10 where it means zero."""
_THRUST = ["ax_m_s2", "ay_m_s2", "az_m_s2"]


def time_figure(results: Results, looks: Looks) -> go.Figure:
    """Position error, thrust and accumulated delta-v over time, outages shaded, phases marked."""
    scenario, flights = results.flown.scenario, results.flown.flights
    period_s = scenario.orbit.period_s
    limit_mm_s2 = 1e3 * scenario.spacecraft.max_accel_m_s2
    heights = [0.44, 0.28, 0.28]
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.035, row_heights=heights)
    for name in results.ranking:
        flight = flights[name]
        shown = flight.iloc[style.thinned(len(flight))]
        time = (shown["time_s"] / period_s).to_numpy(np.float32)
        total = flight["delta_v_m_s"].cumsum().loc[shown.index]
        thrust = 1e3 * np.linalg.norm(flight[_THRUST].shift(-1).ffill().loc[shown.index].to_numpy(), axis=1)
        thrust = np.where(thrust < THRUST_FLOOR * limit_mm_s2, np.nan, thrust)
        for row, values in enumerate((shown["position_error_m"].to_numpy(), thrust, total.to_numpy()), start=1):
            trace = _line(time, values, name, looks, first=row == 1, stepped=row == 2)
            trace.update(visible="legendonly" if name in results.hidden else True)
            figure.add_trace(trace, row=row, col=1)
    figure.update_layout(style.base_layout(620), hovermode="x")
    figure.update_layout(legend={"orientation": "h", "x": 0, "y": -0.12, "yanchor": "top"})
    for row, title in enumerate(ROWS, start=1):
        figure.update_yaxes(style.axis(title, log=row < 3), row=row, col=1)
    figure.update_yaxes(rangemode="tozero", row=3, col=1)
    ends = np.log10(np.array([THRUST_FLOOR, 2.0]) * limit_mm_s2)  # three axes together reach sqrt(3) times the limit
    figure.update_yaxes(range=ends.tolist(), row=2, col=1)
    end = scenario.num_steps * scenario.dt_s / period_s
    figure.update_xaxes(gridcolor=style.GRID, zeroline=False, range=[0, end])
    figure.update_xaxes(title={"text": f"time, orbits of {period_s / 60:.1f} min"}, row=3, col=1)
    _mark(figure, scenario, flights.values())
    return figure


def _line(time: np.ndarray, values: np.ndarray, name: str, looks: Looks, first: bool, stepped: bool) -> go.Scatter:
    """One quantity of one episode; thrust is constant over a step."""
    look = looks[name]
    line = {"color": look.color, "dash": look.dash, "width": 1.2 if stepped else 1.8}
    line["shape"] = "hv" if stepped else "linear"
    trace = go.Scatter(x=time, y=values.astype(np.float32), mode="lines", line=line, name=name)
    return trace.update(legendgroup=name, showlegend=first, hovertemplate="%{y:.4g}")


def _mark(figure: go.Figure, scenario: Scenario, flights: Iterable[pd.DataFrame]) -> None:
    """Shade outages, and mark tolerance, arrivals and phases."""
    longest = max(flights, key=len)
    shade = outage_path(longest, scenario)
    if shade:
        band = {"type": "path", "path": shade, "xref": "x", "yref": "paper", "layer": "below", "name": "no measurement"}
        figure.add_shape(**band, fillcolor=style.SHADE, line_width=0, showlegend=True)
    width = {"color": style.NEUTRAL, "width": 1.3}
    tolerance = {"type": "line", "xref": "x domain", "x0": 0, "x1": 1, "y0": scenario.tolerance_m, "yref": "y"}
    figure.add_shape(**tolerance, y1=scenario.tolerance_m, line=width | {"dash": "dot"}, name="tolerance")
    figure.layout.shapes[-1].showlegend = True
    for start, end, text in phases(scenario):
        label = {"text": text, "showarrow": False, "xref": "x", "yref": "paper", "y": 1.0, "yanchor": "bottom"}
        figure.add_annotation(**label, x=(start + end) / 2, font={"size": 12})
        if start > 0:
            place = {"type": "line", "xref": "x", "x0": start, "x1": start, "yref": "paper", "y0": 0, "y1": 1.03}
            figure.add_shape(**place, line=width | {"dash": "dash"})


def phases(scenario: Scenario) -> list[tuple[float, float, str]]:
    """Transfers and holds: start and end in orbits, and a name."""
    result = []
    unit = scenario.dt_s / scenario.orbit.period_s
    for leg in legs(scenario):
        if leg.arrival > leg.start:
            result.append((leg.start * unit, leg.arrival * unit, "transfer"))
        result.append((leg.arrival * unit, leg.end * unit, f"hold: {formation_name(leg.phase.formation)}"))
    return result


def formation_name(formation: object) -> str:
    """A formation's name for people."""
    return str(getattr(formation, "kind", "formation")).replace("_", " ")


def outage_path(flight: pd.DataFrame, scenario: Scenario) -> str:
    """The instants without a measurement as one SVG path: x in orbits, y from 0 to 1; empty if there are none."""
    lost = np.r_[0, ~flight["measured"].to_numpy(bool), 0].astype(int)
    starts, ends = np.flatnonzero(np.diff(lost) == 1), np.flatnonzero(np.diff(lost) == -1)
    if len(starts) == 0:
        return ""
    apart = np.flatnonzero(starts[1:] - ends[:-1] > len(flight) / RESOLVED_BANDS)
    starts, ends = starts[np.r_[0, apart + 1]], ends[np.r_[apart, len(ends) - 1]]
    unit = scenario.dt_s / scenario.orbit.period_s
    spans = np.clip((np.column_stack([starts, ends]) - 0.5) * unit, 0, None)
    return " ".join(f"M {a:.5f},0 L {b:.5f},0 L {b:.5f},1 L {a:.5f},1 Z" for a, b in spans)
