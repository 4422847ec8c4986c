"""What the flights say: means with intervals, paired differences, and a reading in words."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from tqdm import tqdm

from baselines.experiments.comparison import Flown
from baselines.optimal import cost_ratio
from formation_env.evaluation.statistics import bootstrap_interval, paired_difference, summarise
from formation_env.kernel.metrics import METRICS
from formation_env.numerics.arrays import Array

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
        reference: the best of the policies that flew all seeds.
        summaries: policy -> table of `formation_env.evaluation.summarise`; of a policy that flew fewer seeds estimates
            over all of them, see `estimate`.
        differences: compared-with policy -> policy -> metric -> mean difference and interval, on the seeds of both.
        bounds: least cost that was possible on each seed (seeds,), m/s; None where it is not known.
        cost_ratios: policy -> mean cost over bound and its interval on its own seeds; empty without bounds above 0.
    """

    flown: Flown
    ranking: list[str]
    reference: str
    summaries: dict[str, pd.DataFrame]
    differences: dict[str, dict[str, dict[str, Interval]]]
    bounds: Array | None
    cost_ratios: dict[str, Interval]

    @property
    def best(self) -> str:
        """The policy of the best mean return."""
        return self.ranking[0]

    @property
    def hidden(self) -> list[str]:
        """Policies whose flights are hidden at first, because they would squash the axes."""
        limit = HIDE_ABOVE * -self.mean(self.best, "return")
        return [name for name in self.ranking if -self.mean(name, "return") > limit]

    @property
    def partial(self) -> list[str]:
        """Policies that flew fewer seeds than the others."""
        return [name for name in self.ranking if self.count(name) < self.count(self.reference)]

    def count(self, policy: str) -> int:
        """Episodes that a policy flew."""
        return len(self.flown.episodes[policy])

    def interval(self, policy: str, metric: str) -> Interval:
        """Mean of a metric with its 95 % interval."""
        line = self.summaries[policy].loc[metric]
        return float(line["mean"]), float(line["low"]), float(line["high"])

    def cost(self, policy: str) -> Interval:
        """Mean cost, minus the return, with its interval, m/s."""
        return negative(self.interval(policy, "return"))

    def behind(self, policy: str, other: str) -> Interval:
        """How much more than a compared-with policy another one costs on the seeds of both, m/s."""
        return negative(self.differences[policy][other]["return"])

    def over(self, policy: str, other: str) -> Interval:
        """Mean cost over another policy's, on the seeds of both."""
        common = min(self.count(policy), self.count(other))
        ours, theirs = (-self.flown.episodes[name]["return"].to_numpy(float)[:common] for name in (policy, other))
        return ratio_of_means(ours, theirs)

    def mean(self, policy: str, metric: str) -> float:
        """Mean of a metric."""
        return self.interval(policy, metric)[0]

    def best_of(self, metric: str) -> list[str]:
        """The policies with the best mean of a metric; none if all are equal, or no value is better than another."""
        if METRICS[metric].better is None:
            return []
        means = {name: self.mean(name, metric) for name in self.ranking}
        pick = max if METRICS[metric].better == "higher" else min
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
    episodes = flown.episodes
    longest = max(len(table) for table in episodes.values())
    full = [name for name, table in episodes.items() if len(table) == longest]
    reference = max(full, key=lambda name: episodes[name]["return"].mean())
    summaries = {}
    for name, table in episodes.items():
        summaries[name] = summarise(table) if name in full else estimate(table, episodes[reference], bounds)
        bar.update()
    ranking = sorted(summaries, key=lambda name: -summaries[name].loc["return", "mean"])
    compared = dict.fromkeys([ranking[0], *([REFERENCE] if REFERENCE in summaries else [])])
    differences = {other: _differences(episodes, other) for other in compared}
    above = bounds is not None and (bounds > 0).all()  # where errors are free, so is the best flight
    cost_ratios = {} if not above else {name: _cost_ratio(table, bounds) for name, table in episodes.items()}
    return Results(flown, ranking, reference, summaries, differences, bounds, cost_ratios)


def estimate(few: pd.DataFrame, reference: pd.DataFrame, bounds: Array | None) -> pd.DataFrame:
    """What a policy that flew some of the seeds would have as means over all: the reference's and the difference.

    The seeds that were flown may be easy or hard ones; the difference to what they cost another policy, or must cost,
    is nearly free of that. Half-widths of the two intervals, of the reference over all seeds and of the difference,
    add as squares.

    Args:
        few: episodes of the policy.
        reference: episodes of a policy on all seeds, these among them as the first.
        bounds: least costs of all seeds (seeds,), m/s, if they are known: for the return they take the reference's
            place if the difference to them scatters less.
    """
    if bounds is not None:
        costs = -few["return"].to_numpy(float)
        known = (-reference["return"].to_numpy(float), bounds)
        nearest = min(known, key=lambda cost: np.std(costs - cost[: len(costs)]))
        reference = reference.assign(**{"return": -nearest})
    rows, summary = {}, summarise(reference)
    for metric in METRICS:
        mean, low, high = _difference(few, reference, metric)
        base, base_low, base_high = (float(summary.loc[metric, column]) for column in ("mean", "low", "high"))
        below, above = math.hypot(mean - low, base - base_low), math.hypot(high - mean, base_high - base)
        rows[metric] = (base + mean, base + mean - below, base + mean + above)
    return pd.DataFrame.from_dict(rows, orient="index", columns=["mean", "low", "high"])


def _cost_ratio(episodes: pd.DataFrame, bounds: Array) -> Interval:
    """Mean cost over bound, seed by seed, with its interval."""
    found = cost_ratio(-episodes["return"].to_numpy(float), bounds[: len(episodes)])
    return found.mean, found.low, found.high


def _differences(episodes: dict[str, pd.DataFrame], reference: str) -> dict[str, dict[str, Interval]]:
    """Policy -> metric -> difference to the reference's."""
    return {
        name: {metric: _difference(table, episodes[reference], metric) for metric in COMPARED}
        for name, table in episodes.items()
        if name != reference
    }


def _difference(episodes: pd.DataFrame, reference: pd.DataFrame, metric: str) -> Interval:
    """The paired difference on the seeds that both flew."""
    common = min(len(episodes), len(reference))
    return paired_difference(episodes.iloc[:common], reference.iloc[:common], metric)


def ratio_of_means(above: Array, below: Array) -> Interval:
    """Ratio of the means of paired values (n,), with its 95 % interval: the bootstrap's, of the linearised ratio."""
    ratio = above.mean() / below.mean()
    # each pair's share in a small change of the ratio (Cochran 1977, chapter 6)
    return float(ratio), *bootstrap_interval(ratio + (above - ratio * below) / below.mean())


def negative(interval: Interval) -> Interval:
    """Mean, low and high of minus a quantity."""
    mean, low, high = interval
    return -mean, -high, -low


def significant(difference: Interval) -> bool:
    """Whether the interval leaves out zero."""
    return difference[1] > 0 or difference[2] < 0


def summary_table(results: list[Results]) -> pd.DataFrame:
    """All means and intervals: env, policy, metric, mean, low, high, episodes."""
    lines = [
        (item.flown.label, name, metric, *item.interval(name, metric), item.count(name))
        for item in results
        for name in item.flown.episodes
        for metric in METRICS
    ]
    return pd.DataFrame(lines, columns=["env", "policy", "metric", "mean", "low", "high", "episodes"])


def episode_table(results: list[Results]) -> pd.DataFrame:
    """One line per environment, policy and seed, with all metrics."""
    tables = []
    for item in results:
        for name, table in item.flown.episodes.items():
            tables.append(table.assign(env=item.flown.label, policy=name))
    return pd.concat(tables, ignore_index=True)[["env", "policy", "seed", *METRICS]]
