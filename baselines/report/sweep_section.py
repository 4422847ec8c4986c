"""One environment's sweep on a page: figures and sentences."""

from typing import Any

import pandas as pd

from baselines.experiments.estimates import MIN_VERDICT_EPISODES, significant
from baselines.experiments.statistics import HIDE_ABOVE
from baselines.experiments.sweep import BOUND, Sweep
from baselines.experiments.variations import FRONT, VARIATIONS
from baselines.report.html import div
from baselines.report.sweep_figures import Looks, difference_figure, robustness_figure, trade_off_figure
from baselines.report.text import number
from formation_env.evaluation.statistics import paired_difference
from formation_env.task.scenario import Scenario


def section(index: int, scenario: Scenario, sweep: Sweep, looks: Looks) -> dict[str, Any] | None:
    """Variables of the template `sweep_section` for one environment; None if nothing was flown there.

    Args:
        index: of the environment on the page.
        scenario: the environment.
        sweep: its own part.
        looks: of the policies and of the bound.
    """
    summary = sweep.summary
    if summary.empty:
        return None
    aside = expensive(summary)
    bound = sweep.episodes[sweep.episodes["policy"] == BOUND]
    return {
        "weight": scenario.reward.error_weight,
        "weights": summary.loc[summary["quantity"] == FRONT, "value"].unique().tolist(),
        "episodes": sweep.episodes["seed"].nunique(),
        "min_episodes": MIN_VERDICT_EPISODES,
        "bound_episodes": bound["seed"].nunique(),
        "aside": aside,
        "reading": reading(sweep.episodes, summary),
        "reference": str(summary["reference"].iloc[0]),
        "compared": summary.loc[summary["policy"] != BOUND, "policy"].nunique() > 1,
        "trade_off": div(trade_off_figure(summary, looks, aside), f"trade-off-{index}"),
        "robustness": div(robustness_figure(summary, looks, aside), f"robustness-{index}"),
        "differences": div(difference_figure(summary, looks, aside), f"differences-{index}"),
    }


def expensive(summary: pd.DataFrame) -> list[str]:
    """Policies that cost `HIDE_ABOVE` times as much as the best at most points: they would squash the others."""
    flown = summary[summary["policy"] != BOUND]
    costs = flown.pivot(index=["quantity", "value"], columns="policy", values="cost_m_s")
    ratios = costs.div(costs.min(axis=1), axis=0).median()
    return [str(name) for name in ratios.index[ratios > HIDE_ABOVE]]


def reading(episodes: pd.DataFrame, summary: pd.DataFrame) -> list[str]:
    """One environment's sweep in plain sentences."""
    lines = [*_against_bound(episodes)]
    policies = summary[summary["policy"] != BOUND]
    if policies["policy"].nunique() > 1:
        flown = episodes[episodes["policy"] != BOUND]
        lines += [_winners(name, flown[flown["quantity"] == name]) for name in VARIATIONS]
    early = int(policies["ended_early"].sum())
    if early:
        lines.append(f"A limit ended {early} of {int(policies['episodes'].sum())} episodes early.")
    return lines


def _against_bound(episodes: pd.DataFrame) -> list[str]:
    """Cost ratio of the policies along the trade-off, on the bound's seeds."""
    costs = episodes[episodes["quantity"] == FRONT].pivot(index=["value", "seed"], columns="policy", values="cost_m_s")
    if BOUND not in costs:
        return []
    costs = costs.dropna()
    ratios = costs.drop(columns=BOUND).div(costs[BOUND], axis=0).groupby("value").mean()
    spans = [f"{name} {number(ratios[name].min())} to {number(ratios[name].max())}" for name in ratios]
    return [f"Cost over the bound along the trade-off, on the bound's seeds: {', '.join(spans)} times."]


def _winners(quantity: str, episodes: pd.DataFrame) -> str:
    """Policies of lowest cost, and at which values."""
    variation, where = VARIATIONS[quantity], dict[str, list[str]]()
    for value, flown in episodes.groupby("value"):
        text = variation.names.get(float(str(value)), f"{value:g}")
        where.setdefault(_cheapest(flown), []).append(text.replace("-", "−"))
    if len(where) == 1:
        return f"{_capital(variation.label)}: {next(iter(where))} at every value."
    parts = [f"{names} at {', '.join(values)}" for names, values in where.items()]
    return f"{_capital(variation.label)}: {'; '.join(parts)}."


def _cheapest(flown: pd.DataFrame) -> str:
    """The policy of lowest mean cost at a point, and those that do not differ from it significantly.

    With too few episodes for a verdict, the lowest mean alone.
    """
    ranking = flown.groupby("policy")["cost_m_s"].mean().sort_values().index
    tables = [flown[flown["policy"] == name] for name in ranking]
    if len(tables[0]) < MIN_VERDICT_EPISODES:
        return str(ranking[0])
    near = [
        str(name)
        for name, table in zip(ranking[1:], tables[1:], strict=True)
        if not significant(paired_difference(table, tables[0], "cost_m_s"))
    ]
    return " or ".join([str(ranking[0]), *near])


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
