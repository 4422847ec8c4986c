"""Statistics of a comparison: means with intervals, paired differences, and who may be called better."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from baselines.experiments.comparison import Flown
from baselines.experiments.estimates import (
    MIN_VERDICT_EPISODES,
    Interval,
    cost_ratios,
    differences,
    estimate,
    negative,
    ratio_of_means,
    row_interval,
    significant,
)
from baselines.experiments.progress import progress_bar
from formation_env.evaluation.statistics import bootstrap_interval, summarise
from formation_env.kernel.metrics import METRICS
from formation_env.numerics.arrays import Array

REFERENCE = "lqr"
"""Policies are compared with the best one and with this one."""
HIDE_ABOVE = 3.0
"""Policies that cost this many times the best are hidden at first in figures: they would squash the others."""


@dataclass(frozen=True)
class Results:
    """One environment's episodes and their statistics.

    Attributes:
        flown: the episodes.
        ranking: policies, best mean return first; the means of policies with fewer seeds are estimates.
        reference: the best of the policies that flew all seeds.
        summaries: policy -> table of `formation_env.evaluation.summarise` over all seeds; for a policy that flew fewer
            seeds an estimate, see `estimate`.
        differences: compared-with policy -> policy -> metric -> mean difference and interval, on the seeds of both.
        bounds: perfect-information bound of each seed (seeds,), m/s; None where it is not known.
        cost_ratios: policy -> mean cost over bound and its interval, over all seeds; for a policy that flew fewer seeds
            an estimate, as its summary is. Empty without bounds above 0.
        cost_ratios_flown: the same over the seeds that each policy flew.
    """

    flown: Flown
    ranking: list[str]
    reference: str
    summaries: dict[str, pd.DataFrame]
    differences: dict[str, dict[str, dict[str, Interval]]]
    bounds: Array | None
    cost_ratios: dict[str, Interval]
    cost_ratios_flown: dict[str, Interval]

    @property
    def best(self) -> str:
        """The policy of best mean return among those that flew enough episodes for a verdict, if there are any."""
        enough = [name for name in self.ranking if self.count(name) >= MIN_VERDICT_EPISODES]
        return enough[0] if enough else self.reference

    @property
    def hidden(self) -> list[str]:
        """Policies that are hidden at first in figures, because they would squash the axes."""
        limit = HIDE_ABOVE * -self.mean(self.best, "return")
        return [name for name in self.ranking if -self.mean(name, "return") > limit]

    @property
    def partial(self) -> list[str]:
        """Policies that flew fewer seeds than the others; their means are estimates."""
        return [name for name in self.ranking if self.count(name) < self.count(self.reference)]

    def count(self, policy: str) -> int:
        """Episodes that a policy flew."""
        return len(self.flown.episodes[policy])

    def common(self, policy: str, other: str) -> int:
        """Seeds that both policies flew."""
        return min(self.count(policy), self.count(other))

    def interval(self, policy: str, metric: str) -> Interval:
        """Mean of a metric over all seeds with its 95 % interval."""
        return row_interval(self.summaries[policy], metric)

    def cost(self, policy: str) -> Interval:
        """Mean cost over all seeds, minus the return, with its interval, m/s."""
        return negative(self.interval(policy, "return"))

    def cost_flown(self, policy: str, seeds_of: str | None = None) -> Interval:
        """Mean cost, m/s, over the seeds that a policy flew, or that another one flew too, with its interval."""
        count = self.common(policy, seeds_of or policy)
        costs = -self.flown.episodes[policy]["return"].to_numpy(float)[:count]
        return float(costs.mean()), *bootstrap_interval(costs)

    def behind(self, policy: str, other: str) -> Interval:
        """Extra cost of another policy over a reference, on the seeds of both, m/s."""
        return negative(self.differences[policy][other]["return"])

    def verdict(self, policy: str, other: str) -> bool | None:
        """Whether a policy differs significantly from a compared-with one in cost; None if too few seeds are common."""
        if self.common(policy, other) < MIN_VERDICT_EPISODES:
            return None
        return significant(self.behind(other, policy))

    def over(self, policy: str, other: str) -> Interval:
        """Mean cost over another policy's, on the seeds of both."""
        common = self.common(policy, other)
        ours, theirs = (-self.flown.episodes[name]["return"].to_numpy(float)[:common] for name in (policy, other))
        return ratio_of_means(ours, theirs)

    def mean(self, policy: str, metric: str) -> float:
        """Mean of a metric over all seeds."""
        return self.interval(policy, metric)[0]

    def best_of(self, metric: str) -> list[str]:
        """The policies with the best mean of a metric, of those that flew all seeds; none if no value is better."""
        better = METRICS[metric].better
        if better is None:
            return []
        means = {name: self.mean(name, metric) for name in self.ranking if name not in self.partial}
        pick = max if better == "higher" else min
        top = pick(means.values())
        return [name for name, value in means.items() if value == top] if len(set(means.values())) > 1 else []

    def ended_early(self, policy: str) -> int:
        """Episodes that a limit ended."""
        return int((self.flown.episodes[policy]["steps"] < self.flown.scenario.num_steps).sum())


def analyse(flown: list[Flown], bounds: Mapping[str, Array]) -> list[Results]:
    """Statistics of all environments, with a progress bar (the bootstrap takes a while for many episodes).

    Args:
        flown: the episodes.
        bounds: perfect-information bounds (seeds,) by environment, where they are known.
    """
    with progress_bar(sum(len(item.episodes) for item in flown), "statistics", "policy") as bar:
        results = []
        for item in flown:
            bar.describe(item.label)
            results.append(_analyse_one(item, bounds.get(item.label)))
            bar.advance(len(item.episodes))
        return results


def _analyse_one(flown: Flown, bounds: Array | None) -> Results:
    episodes = flown.episodes
    longest = max(len(table) for table in episodes.values())
    full = [name for name, table in episodes.items() if len(table) == longest]
    reference = max(full, key=lambda name: episodes[name]["return"].mean())
    summaries = {
        name: summarise(table) if name in full else estimate(table, episodes[reference], bounds)
        for name, table in episodes.items()
    }
    ranking = sorted(summaries, key=lambda name: -row_interval(summaries[name], "return")[0])
    ratios, ratios_flown = cost_ratios(episodes, reference, bounds)
    results = Results(flown, ranking, reference, summaries, {}, bounds, ratios, ratios_flown)
    for other in dict.fromkeys([results.best, *([REFERENCE] if REFERENCE in summaries else [])]):
        results.differences[other] = differences(episodes, other)
    return results


def summary_table(results: list[Results]) -> pd.DataFrame:
    """All means and intervals: env, policy, metric, mean, low, high, episodes, estimated."""
    lines = [
        (item.flown.label, name, metric, *item.interval(name, metric), item.count(name), name in item.partial)
        for item in results
        for name in item.flown.episodes
        for metric in METRICS
    ]
    return pd.DataFrame(lines, columns=["env", "policy", "metric", "mean", "low", "high", "episodes", "estimated"])


def episode_table(results: list[Results]) -> pd.DataFrame:
    """One line per environment, policy and seed, with all metrics."""
    tables = []
    for item in results:
        for name, table in item.flown.episodes.items():
            tables.append(table.assign(env=item.flown.label, policy=name))
    return pd.concat(tables, ignore_index=True)[["env", "policy", "seed", *METRICS]]
