"""The HTML page: one file that needs no network."""

from typing import Any

from baselines.experiments.statistics import Results, significant
from baselines.experiments.sweep import Sweep
from baselines.report import html
from baselines.report.flight_figures import time_figure
from baselines.report.scene_figure import scene_figure
from baselines.report.score_figures import Looks, cost_figure, trade_figure
from baselines.report.sweep_figures import looks_of
from baselines.report.sweep_section import section
from baselines.report.words import duration, fewer, headline, number, numbers, reading
from formation_env.kernel.metrics import METRICS


def render(results: list[Results], sweep: Sweep, data: dict[str, Any]) -> str:
    """The page of all environments: one file that needs no network.

    Args:
        results: what to show.
        sweep: fronts and robustness.
        data: the report as data (`baselines.report.json_document`).
    """
    policies = list(dict.fromkeys(name for item in results for name in item.flown.episodes))
    looks = looks_of(policies)
    return html.render(
        "page.html.jinja",
        {
            "data": data,
            "policies": policies,
            "colors": {name: look.color for name, look in looks.items()},
            "overview": [_overview(item, policies) for item in results],
            "sections": [_section(index, item, sweep, looks, data) for index, item in enumerate(results)],
        },
    )


def _overview(results: Results, policies: list[str]) -> dict[str, Any]:
    """A line of the first table: mean cost of each policy on one environment."""
    costs = {name: numbers(results.cost(name))[0] for name in results.flown.episodes}
    bound = "–" if results.bounds is None else number(float(results.bounds.mean()))
    line = {"label": results.flown.label, "best": results.best, "bound": bound}
    return line | {"costs": [(name, costs.get(name)) for name in policies]}


def _section(index: int, results: Results, sweep: Sweep, looks: Looks, data: dict[str, Any]) -> dict[str, Any]:
    """All that the template shows of one environment."""
    flown = results.flown
    details = data["environments"][flown.label]
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
        "columns": _columns(),
        "rows": [_row(results, name) for name in results.ranking],
        "versus": results.best,
        "bound": None if results.bounds is None else number(float(results.bounds.mean())),
        "figures": {key: html.div(figure, f"{key}-{index}") for key, figure in figures.items()},
        "zero_thrust": any((table["delta_v_m_s"] <= 0).any() for table in flown.episodes.values()),
        "hidden": results.hidden,
        "flight_seed": flown.flight_seed,
        "flights": [_flight(results, name) for name in results.ranking],
        "tolerance_m": flown.scenario.tolerance_m,
        "weight": flown.scenario.reward.error_weight,
        "details": details,
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


def _columns() -> list[tuple[str, str, str]]:
    """Metric, heading and unit of each column."""
    return [(name, metric.heading, metric.unit) for name, metric in METRICS.items() if name != "steps"]


def _row(results: Results, name: str) -> dict[str, Any]:
    """A policy's line of the table."""
    cells = []
    for metric, _, _ in _columns():
        factor = METRICS[metric].factor
        mean, *ends = numbers(results.interval(name, metric), factor)
        low, high = ends if factor > 0 else ends[::-1]
        best = name in results.best_of(metric)
        cells.append({"mean": mean, "low": low, "high": high, "best": best})
    ratio = numbers(results.cost_ratios[name]) if results.cost_ratios else None
    return {
        "policy": name,
        "best": name == results.best,
        "cells": cells,
        "versus": _versus(results, name),
        "episodes": results.count(name),
        "action_time": duration(results.flown.action_time_us(name)),
        "cost_ratio": ratio and dict(zip(("mean", "low", "high"), ratio, strict=True)),
    }


def _versus(results: Results, name: str) -> dict[str, Any] | None:
    """The paired difference of the cost to the best policy's."""
    if name == results.best:
        return None
    difference = results.behind(results.best, name)
    mean, low, high = numbers(difference)
    return {"mean": mean, "low": low, "high": high, "significant": significant(difference)}


def _flight(results: Results, name: str) -> dict[str, str]:
    """What the flight shown in full came to."""
    flight = results.flown.flights[name]
    return {
        "policy": name,
        "delta_v": number(float(flight["delta_v_m_s"].sum())),
        "final": number(float(flight["position_error_m"].iloc[-1])),
    }
