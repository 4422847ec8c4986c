"""Intervals of means: estimates carried over from a few seeds to all, ratios, and paired differences."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from baselines.optimal import cost_ratio
from formation_env.evaluation.statistics import bootstrap_interval, paired_difference, summarise
from formation_env.kernel.metrics import METRICS
from formation_env.numerics.arrays import Array

COMPARED = ("return", "delta_v_m_s", "position_error_mean_m")
"""Metrics whose paired differences are given."""
MIN_VERDICT_EPISODES = 20
"""Fewer episodes allow no verdict: with 5 the interval of a skewed cost misses the mean far too often."""

Interval = tuple[float, float, float]
"""Mean, low and high end of its 95 % interval."""


def estimate(few: pd.DataFrame, reference: pd.DataFrame, bounds: Array | None) -> pd.DataFrame:
    """Estimated means over all seeds of a policy that flew some of them.

    The seeds flown may be easy or hard; the difference to another policy's cost, or to the bound, on the same seeds is
    nearly free of that. So the estimate is the reference's mean over all seeds plus the mean paired difference. The
    half-widths of the two intervals add in quadrature.

    Args:
        few: episodes of the policy.
        reference: episodes of a policy on all seeds, the policy's as the first.
        bounds: perfect-information bounds of all seeds (seeds,), m/s, if they are known: for the return they replace
            the reference if the difference to them scatters less.
    """
    if bounds is not None:
        costs = -few["return"].to_numpy(float)
        known = (-reference["return"].to_numpy(float), bounds)
        nearest = min(known, key=lambda cost: np.std(costs - cost[: len(costs)]))
        reference = reference.assign(**{"return": -nearest})
    rows, summary = {}, summarise(reference)
    for metric in METRICS:
        rows[metric] = _sum(_difference(few, reference, metric), row_interval(summary, metric))
    return pd.DataFrame.from_dict(rows, orient="index", columns=["mean", "low", "high"])


def row_interval(summary: pd.DataFrame, metric: str) -> Interval:
    """A metric's line of a summary."""
    mean, low, high = summary.loc[[metric], ["mean", "low", "high"]].to_numpy(float)[0]
    return float(mean), float(low), float(high)


def _sum(one: Interval, other: Interval) -> Interval:
    """Sum of two independent means; the half-widths of their intervals add in quadrature."""
    mean = one[0] + other[0]
    below, above = math.hypot(one[0] - one[1], other[0] - other[1]), math.hypot(one[2] - one[0], other[2] - other[0])
    return mean, mean - below, mean + above


def cost_ratios(
    episodes: Mapping[str, pd.DataFrame], reference: str, bounds: Array | None
) -> tuple[dict[str, Interval], dict[str, Interval]]:
    """Cost over bound of each policy: over all seeds, estimated if it flew fewer, and over the seeds that it flew."""
    if bounds is None or not (bounds > 0).all():  # where errors are free, so is the best flight
        return {}, {}
    ratios = {
        name: cost_ratio(-table["return"].to_numpy(float), bounds[: len(table)]) for name, table in episodes.items()
    }
    flown = {name: (found.mean, found.low, found.high) for name, found in ratios.items()}
    every, base = dict(flown), ratios[reference].ratios
    for name, found in ratios.items():
        if len(found.ratios) < len(base):
            difference = found.ratios - base[: len(found.ratios)]
            every[name] = _sum((float(difference.mean()), *bootstrap_interval(difference)), flown[reference])
    return every, flown


def differences(episodes: dict[str, pd.DataFrame], reference: str) -> dict[str, dict[str, Interval]]:
    """Policy -> metric -> difference to the reference's."""
    return {
        name: {metric: _difference(table, episodes[reference], metric) for metric in COMPARED}
        for name, table in episodes.items()
        if name != reference
    }


def _difference(episodes: pd.DataFrame, reference: pd.DataFrame, metric: str) -> Interval:
    """The paired difference on the seeds of both."""
    common = min(len(episodes), len(reference))
    return paired_difference(episodes.iloc[:common], reference.iloc[:common], metric)


def ratio_of_means(above: Array, below: Array) -> Interval:
    """Ratio of the means of paired values (n,), with its 95 % interval: the bootstrap's, of the linearised ratio."""
    ratio = above.mean() / below.mean()
    # each pair's contribution to a small change of the ratio (Cochran 1977, chapter 6)
    return float(ratio), *bootstrap_interval(ratio + (above - ratio * below) / below.mean())


def negative(interval: Interval) -> Interval:
    """Mean, low and high of minus a quantity."""
    mean, low, high = interval
    return -mean, -high, -low


def significant(difference: Interval) -> bool:
    """Whether the interval excludes zero."""
    return difference[1] > 0 or difference[2] < 0
