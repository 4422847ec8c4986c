"""What the flights say: means with intervals, paired differences, and a reading in words."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from tqdm import tqdm

from baselines.fuel import regret
from baselines.report.flights import Flown
from formation_env.dynamics.base import Array
from formation_env.evaluation import paired_difference, summarise
from formation_env.metrics import METRICS

COMPARED = ("return", "delta_v_m_s", "position_error_mean_m")
"""Metrics whose paired differences are given."""
REFERENCE = "lqr"
"""Besides the best policy, the one that all are compared with."""
HIDE_ABOVE = 3.0
"""Policies that cost this many times as much as the best are hidden at first in the pictures, or they squash them."""

Interval = tuple[float, float, float]
"""Mean, low and high end of its 95 % interval."""


@dataclass(frozen=True)
class Results:
    """One environment's flights and their statistics.

    Attributes:
        flown: the flights.
        ranking: policies, best mean return first.
        summaries: policy -> table of `formation_env.evaluation.summarise`.
        differences: compared-with policy -> policy -> metric -> mean difference and interval, on the same seeds.
        bounds: least cost that was possible on each seed (seeds,), m/s; None where it is not known.
        regrets: policy -> mean cost over bound and its interval; empty without bounds.
    """

    flown: Flown
    ranking: list[str]
    summaries: dict[str, pd.DataFrame]
    differences: dict[str, dict[str, dict[str, Interval]]]
    bounds: Array | None
    regrets: dict[str, Interval]

    @property
    def best(self) -> str:
        """The policy of the best mean return."""
        return self.ranking[0]

    @property
    def hidden(self) -> list[str]:
        """Policies whose flights are hidden at first, because they would squash the axes."""
        limit = HIDE_ABOVE * -self.mean(self.best, "return")
        return [name for name in self.ranking if -self.mean(name, "return") > limit]

    def interval(self, policy: str, metric: str) -> Interval:
        """Mean of a metric with its 95 % interval."""
        line = self.summaries[policy].loc[metric]
        return float(line["mean"]), float(line["low"]), float(line["high"])

    def mean(self, policy: str, metric: str) -> float:
        """Mean of a metric."""
        return self.interval(policy, metric)[0]

    def best_of(self, metric: str) -> list[str]:
        """The policies with the best mean of a metric; none if all are equal."""
        means = {name: self.mean(name, metric) for name in self.ranking}
        pick = max if metric in ("return", "in_tolerance") else min
        top = pick(means.values())
        return [name for name, value in means.items() if value == top] if len(set(means.values())) > 1 else []

    def ended_early(self, policy: str) -> int:
        """Episodes that a limit ended."""
        return int((self.flown.episodes[policy]["steps"] < self.flown.scenario.num_steps).sum())


def analyse(flown: list[Flown], bounds: Mapping[str, Array]) -> list[Results]:
    """Statistics of all environments, with a progress bar (the bootstrap takes a while for many episodes).

    Args:
        flown: the flights.
        bounds: least costs (seeds,) by environment, where they are known.
    """
    with tqdm(total=sum(len(item.episodes) for item in flown), desc="statistics", unit="policy", leave=False) as bar:
        return [_analyse_one(item, bounds.get(item.label), bar) for item in flown]


def _analyse_one(flown: Flown, bounds: Array | None, bar: "tqdm[None]") -> Results:
    summaries = {}
    for name, table in flown.episodes.items():
        summaries[name] = summarise(table)
        bar.update()
    ranking = sorted(summaries, key=lambda name: -summaries[name].loc["return", "mean"])
    references = dict.fromkeys([ranking[0], *([REFERENCE] if REFERENCE in summaries else [])])
    differences = {reference: _differences(flown.episodes, reference) for reference in references}
    regrets = {} if bounds is None else {name: _regret(table, bounds) for name, table in flown.episodes.items()}
    return Results(flown, ranking, summaries, differences, bounds, regrets)


def _regret(episodes: pd.DataFrame, bounds: Array) -> Interval:
    """Mean cost over bound, seed by seed, with its interval."""
    found = regret(-episodes["return"].to_numpy(float), bounds)
    return found.mean, found.low, found.high


def _differences(episodes: dict[str, pd.DataFrame], reference: str) -> dict[str, dict[str, Interval]]:
    """Policy -> metric -> difference to the reference's."""
    return {
        name: {metric: paired_difference(table, episodes[reference], metric) for metric in COMPARED}
        for name, table in episodes.items()
        if name != reference
    }


def significant(difference: Interval) -> bool:
    """Whether the interval leaves out zero."""
    return difference[1] > 0 or difference[2] < 0


def reading(results: Results) -> list[str]:
    """The result in plain sentences."""
    best, episodes = results.best, len(results.flown.episodes[results.best])
    cost = numbers(results.interval(best, "return"), -1)[0]
    dv, error = (numbers(results.interval(best, metric))[0] for metric in ("delta_v_m_s", "position_error_mean_m"))
    lines = [
        f"{best} has the best mean return: it costs {cost} m/s per episode, of which {dv} m/s is thrust; "
        f"its mean position error in hold is {error} m."
    ]
    if len(results.ranking) > 1:
        lines.append(_comparison(results, results.ranking[1], episodes))
    if results.regrets:
        lines.append(_against_bound(results))
    lost = [f"{name} in {count}" for name in results.ranking if (count := results.ended_early(name))]
    if lost:
        lines.append(f"Episodes that a limit ended early, of {episodes}: {', '.join(lost)}.")
    return lines


def _against_bound(results: Results) -> str:
    """The best policy against what was possible."""
    assert results.bounds is not None
    ratio, low, high = numbers(results.regrets[results.best])
    return (
        f"Had everything been known beforehand, {number(float(results.bounds.mean()))} m/s would have been enough: "
        f"{results.best} costs {ratio} times the bound of each seed (95 % interval {low} to {high})."
    )


def _comparison(results: Results, second: str, episodes: int) -> str:
    """Best against second best, on the same seeds."""
    best = results.best
    difference = results.differences[best][second]["return"]
    mean, high, low = numbers(difference, -1)
    ours, theirs = (results.flown.episodes[name]["return"].to_numpy() for name in (best, second))
    text = (
        f"Next is {second}, {mean} m/s behind on the same seeds (95 % interval {low} to "
        f"{high}); {best} is better on {int(np.sum(ours > theirs))} of {episodes} seeds. "
    )
    if significant(difference):
        return text + "The difference is significant: the interval leaves out zero."
    return text + "The difference is not significant: the interval holds zero."


def number(value: float) -> str:
    """A number for people: three significant digits, thousands with a comma; a dash if there is none."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return text.replace("-", "−")


def numbers(interval: Interval, factor: float = 1.0) -> tuple[str, str, str]:
    """Mean, low and high for people, with decimals for two digits of the interval's width, but at most four digits."""
    values = [factor * value for value in interval]
    width = abs(values[2] - values[1])
    if not width > 0:
        mean, low, high = (number(value) for value in values)
        return mean, low, high
    digits = 3 - math.floor(math.log10(max(abs(values[0]), width)))
    decimals = max(0, min(digits, 1 - math.floor(math.log10(width))))
    mean, low, high = (f"{value:,.{decimals}f}".replace("-", "−") for value in values)
    return mean, low, high


def summary_table(results: list[Results]) -> pd.DataFrame:
    """All means and intervals: env, policy, metric, mean, low, high."""
    lines = [
        (item.flown.label, name, metric, *item.interval(name, metric))
        for item in results
        for name in item.flown.episodes
        for metric in METRICS
    ]
    return pd.DataFrame(lines, columns=["env", "policy", "metric", "mean", "low", "high"])


def episode_table(results: list[Results]) -> pd.DataFrame:
    """One line per environment, policy and seed, with all metrics."""
    tables = []
    for item in results:
        for name, table in item.flown.episodes.items():
            tables.append(table.assign(env=item.flown.label, policy=name))
    return pd.concat(tables, ignore_index=True)[["env", "policy", "seed", *METRICS]]
