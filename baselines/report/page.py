"""The report's HTML page: one file that needs no network."""

from collections.abc import Sequence
from typing import Any

from baselines.experiments.statistics import Results
from baselines.experiments.sweep import Sweep
from baselines.report import html
from baselines.report.environment_tables import main_table, metrics_table, seeds_flown_table
from baselines.report.flight_figures import THRUST_FLOOR, time_figure
from baselines.report.scene_figure import scene_figure
from baselines.report.score_figures import Looks, cost_figure, trade_figure
from baselines.report.sweep_figures import looks_of
from baselines.report.sweep_section import section
from baselines.report.table import Table
from baselines.report.text import column, fewer, headline, number, reading


def render(results: list[Results], sweep: Sweep, data: dict[str, Any], tables: Sequence[Table] = ()) -> str:
    """The page of all environments: one file that needs no network.

    Args:
        results: to show.
        sweep: trade-off and robustness.
        data: the report as data (`baselines.report.json_document`).
        tables: further tables.
    """
    policies = list(dict.fromkeys(name for item in results for name in item.ranking))
    looks = looks_of(policies)
    return html.render(
        "page.html.jinja",
        {
            "data": data,
            "policies": policies,
            "colors": {name: look.color for name, look in looks.items()},
            "opening": _opening(results[0], looks),
            "overview": _overview(results, policies),
            "tables": [{"title": each.title, "columns": each.columns, "rows": each.texts()} for each in tables],
            "notes": [each.note for each in tables],
            "sections": [_section(index, item, sweep, looks, data) for index, item in enumerate(results)],
        },
    )


def _opening(results: Results, looks: Looks) -> dict[str, Any]:
    """The best policy's recorded episode in space, as the first figure of the page."""
    figure = scene_figure(results, looks, [results.best])
    figure.update_layout(height=420)
    return {"label": results.flown.label, "policy": results.best, "figure": html.div(figure, "opening")}


def _overview(results: Sequence[Results], policies: Sequence[str]) -> dict[str, Any]:
    """The first table: mean cost of each policy (rows) on each environment (columns)."""
    cells: dict[str, list[dict[str, Any] | None]] = {name: [] for name in policies}
    for item in results:
        own = [name for name in policies if name in item.flown.episodes]
        shown = dict(zip(own, column([item.cost(name) for name in own]), strict=True))
        for name, row in cells.items():
            cell = shown.get(name)
            row.append(cell and {"text": cell[0], "best": name == item.best, "estimate": name in item.partial})
    bounds = [None if item.bounds is None else number(float(item.bounds.mean())) for item in results]
    return {"labels": [item.flown.label for item in results], "bounds": bounds, "rows": cells}


def _section(index: int, results: Results, sweep: Sweep, looks: Looks, data: dict[str, Any]) -> dict[str, Any]:
    """Template variables of one environment."""
    flown = results.flown
    figures = {
        "cost": cost_figure(results, looks),
        "trade": trade_figure(results, looks),
        "time": time_figure(results, looks),
        "scene": scene_figure(results, looks),
    }
    return {
        "anchor": f"env-{index}",
        "label": flown.label,
        "title": flown.scenario.title,
        "facts": _facts(results),
        "headline": headline(results),
        "reading": reading(results),
        "fewer": fewer(results),
        "table": main_table(results),
        "metrics": metrics_table(results),
        "seeds_flown": seeds_flown_table(results),
        "versus": results.best,
        "bound": None if results.bounds is None else number(float(results.bounds.mean())),
        "figures": {key: html.div(figure, f"{key}-{index}") for key, figure in figures.items()},
        "zero_thrust": any((table["delta_v_m_s"] <= 0).any() for table in flown.episodes.values()),
        "thrust_floor_percent": 100 * THRUST_FLOOR,
        "hidden": results.hidden,
        "flight_seed": flown.flight_seed,
        "flights": _flights(results),
        "tolerance_m": flown.scenario.tolerance_m,
        "weight": flown.scenario.reward.error_weight,
        "details": data["environments"][flown.label],
        "sweep": section(index, flown.scenario, sweep.of(flown.label), looks),
        "unswept": sweep.faults.get(flown.label),
    }


def _facts(results: Results) -> list[str]:
    """The scenario in a few words."""
    scenario = results.flown.scenario
    seconds = scenario.num_steps * scenario.dt_s
    return [
        f"{seconds / scenario.orbit.period_s:.3g} orbits = {seconds / 3600:.3g} h",
        f"steps of {scenario.dt_s:g} s",
        f"thrust up to {1e3 * scenario.spacecraft.max_accel_m_s2:g} mm/s² per axis",
        f"sensor {scenario.sensor.sigma_pos_m:g} m, {scenario.sensor.sigma_vel_m_s:g} m/s",
        f"tolerance {scenario.tolerance_m:g} m",
        f"cost = Δv + {scenario.reward.error_weight:g} (m/s)/m × mean error",
    ]


def _flights(results: Results) -> list[dict[str, str]]:
    """Delta-v and final error of the recorded episodes."""
    flights = [results.flown.flights[name] for name in results.ranking]
    totals = [float(flight["delta_v_m_s"].sum()) for flight in flights]
    errors = [float(flight["position_error_m"].iloc[-1]) for flight in flights]
    columns = [[cell[0] for cell in column([(x, x, x) for x in values]) if cell] for values in (totals, errors)]
    return [
        {"policy": name, "delta_v": dv, "final": error}
        for name, dv, error in zip(results.ranking, *columns, strict=True)
    ]
