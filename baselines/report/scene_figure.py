"""The recorded episodes in space, in the leader's frame."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from baselines.experiments.statistics import Results
from baselines.report import style
from baselines.report.flight_figures import formation_name
from baselines.report.score_figures import Looks
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs

AXES = {"x": "radial x, km", "y": "along-track y, km", "z": "cross-track z, km"}
_LEAST_SIDE = 0.3
"""No side of the box is shorter than this share of the longest."""
_POSITION = ["x_m", "y_m", "z_m"]


def scene_figure(results: Results, looks: Looks, policies: Sequence[str] = ()) -> go.Figure:
    """True paths, reference paths, leader, starts and arrivals; one scale for all three axes.

    Args:
        results: of the environment.
        looks: of the policies.
        policies: to draw; by default all.
    """
    flown = results.flown
    figure = go.Figure()
    for trace in _plan(flown.scenario):
        figure.add_trace(trace)
    visible = [_corners(flown.scenario)]
    for name in policies or results.ranking:
        flight = flown.flights[name]
        path = 1e-3 * flight[_POSITION].to_numpy()[style.thinned(len(flight))]
        trace = _curve(path, name, {"color": looks[name].color, "width": 4})
        trace.visible = "legendonly" if name in results.hidden else True
        figure.add_trace(trace)
        if name not in results.hidden:
            visible.append(path)
    start = 1e-3 * flown.flights[results.best][_POSITION].to_numpy()[:1]
    figure.add_trace(_points(start, "start", "circle-open", 6))
    corners = _box(np.concatenate(visible))
    figure.add_trace(_unseen(corners))
    figure.update_layout(style.base_layout(600), margin={"l": 0, "r": 0, "t": 8, "b": 8})
    figure.update_layout(
        legend={"orientation": "h", "x": 0, "y": 0, "yanchor": "top"}, scene=_scene(corners[1] - corners[0])
    )
    return figure


def _plan(scenario: Scenario) -> list[go.Scatter3d]:
    """The leader, the reference of each hold, and where it should be reached."""
    traces = [_points(np.zeros((1, 3)), "leader", "cross", 7)]
    grey = {"color": style.NEUTRAL, "width": 3, "dash": "dash"}
    for leg in legs(scenario):
        steps = np.arange(leg.arrival, leg.end + 1)
        path = 1e-3 * leg_reference(scenario, leg, steps[style.thinned(len(steps))])[:, :3]
        traces.append(_curve(path, f"reference: {formation_name(leg.phase.formation)}", grey))
        if leg.arrival > 0:
            traces.append(_points(path[:1], f"arrival {leg.index + 1}", "diamond", 6))
    return traces


def _corners(scenario: Scenario) -> np.ndarray:
    """The leader and all reference positions (points, 3), km: the picture always holds them."""
    paths = [leg_reference(scenario, leg, np.arange(leg.arrival, leg.end + 1))[:, :3] for leg in legs(scenario)]
    return 1e-3 * np.concatenate([np.zeros((1, 3)), *paths])


def _curve(path: np.ndarray, name: str, line: dict[str, object]) -> go.Scatter3d:
    """A path (points, 3), km."""
    x, y, z = path.astype(np.float32).T
    trace = go.Scatter3d(x=x, y=y, z=z, mode="lines", line=line, name=name)
    return trace.update(hovertemplate="x %{x:.4g} km, y %{y:.4g} km, z %{z:.4g} km")


def _points(points: np.ndarray, name: str, symbol: str, size: int) -> go.Scatter3d:
    """Marked points (points, 3), km."""
    x, y, z = points.T
    marker = {"symbol": symbol, "size": size, "color": style.NEUTRAL}
    trace = go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name=name)
    return trace.update(hovertemplate="x %{x:.4g} km, y %{y:.4g} km, z %{z:.4g} km")


def _box(points: np.ndarray) -> np.ndarray:
    """Corners (2, 3), km, of a box around points (points, 3) that is nowhere flat, so its ticks have room."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.maximum(high - low, _LEAST_SIDE * (high - low).max()) / 2
    middle = (low + high) / 2
    return np.array([middle - half, middle + half])


def _unseen(corners: np.ndarray) -> go.Scatter3d:
    """Invisible points that extend the axes."""
    return _points(corners, "", "circle", 1).update(opacity=0, showlegend=False, hoverinfo="skip", hovertemplate=None)


def _scene(sides: np.ndarray) -> dict[str, object]:
    """Three labelled axes of equal scale, seen from far enough to hold a box of the given sides (3,), km."""
    common = {
        "gridcolor": style.GRID,
        "zerolinecolor": style.NEUTRAL,
        "showbackground": False,
        "nticks": 5,
        "color": style.NEUTRAL,
    }
    axes = {f"{name}axis": common | {"title": {"text": title}} for name, title in AXES.items()}
    longest = sides.max() / np.cbrt(sides.prod())  # plotly scales the box to unit volume
    x, y, z = (1.3 + 0.72 * longest) * np.array([0.62, -0.67, 0.41])
    camera = {"eye": {"x": x, "y": y, "z": z}, "center": {"x": 0, "y": 0, "z": -0.14}}
    return {**axes, "aspectmode": "data", "camera": camera, "dragmode": "turntable"}
