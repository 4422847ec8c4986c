"""The sweep's HTML page: one file that needs no network."""

from collections.abc import Mapping
from typing import Any

import jinja2
import pandas as pd
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from baselines.report.page import div
from baselines.report.results import number, significant
from baselines.sweep.figures import Looks, front_figure, looks_of, robustness_figure
from baselines.sweep.flights import BOUND
from baselines.sweep.variations import FRONT, VARIATIONS
from formation_env.evaluation import paired_difference
from formation_env.scenario import Scenario


def render(
    scenarios: Mapping[str, Scenario], episodes: pd.DataFrame, summary: pd.DataFrame, data: dict[str, Any]
) -> str:
    """The page of all environments.

    Args:
        scenarios: by label.
        episodes: one line per episode, see `flights.Point.fly`.
        summary: see `flights.summarise`.
        data: the sweep as data (`report.document`).
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("baselines.sweep"), jinja2.PackageLoader("baselines.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    looks = looks_of([name for name in summary["policy"].unique() if name != BOUND])
    return environment.get_template("sweep.html.jinja").render(
        data=data,
        sections=[
            _section(index, label, scenario, episodes, summary, looks)
            for index, (label, scenario) in enumerate(scenarios.items())
        ],
        plotly_js=Markup(get_plotlyjs()),
    )


def _section(
    index: int, label: str, scenario: Scenario, episodes: pd.DataFrame, summary: pd.DataFrame, looks: Looks
) -> dict[str, Any]:
    """All that the template shows of one environment."""
    here = summary[summary["env"] == label]
    return {
        "anchor": f"env-{index}",
        "label": label,
        "title": scenario.title,
        "weight": scenario.reward.error_weight,
        "reading": reading(episodes[episodes["env"] == label], here),
        "front": div(front_figure(here, looks), f"front-{index}"),
        "robustness": div(robustness_figure(here, looks), f"robustness-{index}"),
    }


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
    """How far above the bound the policies are along the front, on the bound's seeds."""
    costs = episodes[episodes["quantity"] == FRONT].pivot(index=["value", "seed"], columns="policy", values="cost_m_s")
    if BOUND not in costs:
        return []
    costs = costs.dropna()
    ratios = costs.drop(columns=BOUND).div(costs[BOUND], axis=0).groupby("value").mean()
    spans = [f"{name} {number(ratios[name].min())} to {number(ratios[name].max())}" for name in ratios]
    return [f"Cost over the bound along the front, on the bound's seeds: {', '.join(spans)} times."]


def _winners(quantity: str, episodes: pd.DataFrame) -> str:
    """Who costs least, at which values."""
    variation, where = VARIATIONS[quantity], dict[str, list[str]]()
    for value, flown in episodes.groupby("value"):
        text = variation.names.get(float(str(value)), f"{value:g}")
        where.setdefault(_cheapest(flown), []).append(text.replace("-", "−"))
    if len(where) == 1:
        return f"{_capital(variation.label)}: {next(iter(where))} at every value."
    parts = [f"{names} at {', '.join(values)}" for names, values in where.items()]
    return f"{_capital(variation.label)}: {'; '.join(parts)}."


def _cheapest(flown: pd.DataFrame) -> str:
    """The policy of least mean cost at a point, and those that its paired interval does not tell from it."""
    ranking = flown.groupby("policy")["cost_m_s"].mean().sort_values().index
    tables = [flown[flown["policy"] == name] for name in ranking]
    near = [
        str(name)
        for name, table in zip(ranking[1:], tables[1:], strict=True)
        if not significant(paired_difference(table, tables[0], "cost_m_s"))
    ]
    return " or ".join([str(ranking[0]), *near])


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
