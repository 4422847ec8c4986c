"""The tables of one environment, as cells for the template: every column with one number of decimals."""

from collections.abc import Sequence
from typing import Any

from baselines.experiments.statistics import Results
from baselines.report.text import Cells, column, microseconds, number
from formation_env.kernel.metrics import METRICS

MAIN = ("delta_v_m_s", "position_error_mean_m", "in_tolerance")
"""Metrics that stand beside the cost; the others have a table of their own, so that the first fits the page."""
Column = dict[str, Any]


def main_table(results: Results) -> dict[str, Any]:
    """Cost, its ratio to the bound and its paired difference to the best, and the main metrics of each policy."""
    names = results.ranking
    columns = [_metric(results, "return")]
    if results.cost_ratios:
        columns.append(_column("over bound", "ratio", column([results.cost_ratios[name] for name in names])))
    columns += [_versus(results), *(_metric(results, name) for name in MAIN)]
    times = [microseconds(results.flown.action_time_us(name)) for name in names]
    columns.append(_column("time per action", "µs", [(text, text, text) for text in times]))
    columns.append(_column("episodes", "", [(text, text, text) for text in (str(results.count(n)) for n in names)]))
    return _table(results, columns)


def metrics_table(results: Results) -> dict[str, Any]:
    """All other metrics of each policy."""
    return _table(results, [_metric(results, name) for name in METRICS if name not in ("return", "steps", *MAIN)])


def seeds_flown_table(results: Results) -> list[dict[str, Any]]:
    """Measured costs of the policies with fewer seeds, beside the reference's on the same seeds; empty if none has."""
    rows = []
    for name in results.partial:
        costs = (results.cost_flown(name), results.cost_flown(results.reference, name))
        ours, theirs = column(costs)
        bounds = results.bounds
        bound = None if bounds is None else number(float(bounds[: results.count(name)].mean()))
        ratio = column([results.cost_ratios_flown.get(name)])[0]
        rows.append(
            {"policy": name, "seeds": results.count(name), "cells": [ours, theirs, ratio], "bound": bound}
            | {"reference": results.reference}
        )
    return rows


def _table(results: Results, columns: Sequence[Column]) -> dict[str, Any]:
    rows = [
        {
            "policy": name,
            "best": name == results.best,
            "estimate": name in results.partial,
            "cells": [each["cells"][index] for each in columns],
        }
        for index, name in enumerate(results.ranking)
    ]
    return {"headings": [(each["heading"], each["unit"]) for each in columns], "rows": rows}


def _column(heading: str, unit: str, cells: Sequence[Cells | None], best: Sequence[bool] | None = None) -> Column:
    marks = best or [False] * len(cells)
    shown = [
        None if cell is None else {"mean": cell[0], "low": cell[1], "high": cell[2], "best": mark, "note": ""}
        for cell, mark in zip(cells, marks, strict=True)
    ]
    return {"heading": heading, "unit": unit, "cells": shown}


def _metric(results: Results, metric: str) -> Column:
    shown = METRICS[metric]
    best = results.best_of(metric)
    cells = column([results.interval(name, metric) for name in results.ranking], shown.factor)
    return _column(shown.heading, shown.unit, cells, [name in best for name in results.ranking])


def _versus(results: Results) -> Column:
    """Paired difference of the cost to the best policy, with its verdict."""
    best = results.best
    intervals = [None if name == best else results.behind(best, name) for name in results.ranking]
    made = _column(f"against {best}", "m/s, same seeds", column(intervals))
    for name, cell in zip(results.ranking, made["cells"], strict=True):
        if cell is not None:
            verdict = results.verdict(name, best)
            cell["note"] = "no verdict" if verdict is None else "" if verdict else "n.s."
    return made
