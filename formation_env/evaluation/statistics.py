"""Statistics over episodes: means with 95 % confidence intervals, and paired differences."""

from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from formation_env.kernel.metrics import METRICS

FEW_EPISODES: Final = 20
"""Number of episodes from which on intervals are bootstrapped.

Of 4000 samples of a lognormal distribution with a sigma of 0.5 (skewness 1.75) the 95 % interval holds the mean in 92 %
by Student's t and in 81 % by the bootstrap at n = 5, in 92 % and 87 % at n = 10, in 93 % and 91 % at n = 20.
"""
_EQUAL: Final = 1e-12
"""Relative range below which values differ by rounding only."""


def bootstrap_interval(values: NDArray[np.float64], confidence: float = 0.95) -> tuple[float, float]:
    """Confidence interval of the mean of values (n,); the same data give the same interval.

    Bias-corrected and accelerated bootstrap (Efron 1987); below `FEW_EPISODES` values, where that is too narrow,
    Student's t. Equal values, and a single one, give an interval without width.
    """
    values = np.asarray(values, float)
    mean = float(values.mean())
    if len(values) < 2 or np.ptp(values) <= _EQUAL * abs(mean):
        return mean, mean
    if len(values) < FEW_EPISODES:
        half = stats.sem(values) * stats.t.ppf((1 + confidence) / 2, len(values) - 1)
        return float(mean - half), float(mean + half)
    result = stats.bootstrap((values,), np.mean, confidence_level=confidence, rng=np.random.default_rng(0))
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def summarise(episodes: pd.DataFrame) -> pd.DataFrame:
    """Mean and 95 % interval of each metric of `evaluate`'s table: index metric, columns mean, low, high, episodes."""
    lines = []
    for name in METRICS:
        values = episodes[name].to_numpy(float)
        lines.append((float(values.mean()), *bootstrap_interval(values), len(values)))
    return pd.DataFrame(lines, index=list(METRICS), columns=["mean", "low", "high", "episodes"])


def paired_difference(
    episodes: pd.DataFrame, reference: pd.DataFrame, metric: str = "return"
) -> tuple[float, float, float]:
    """Mean difference of a metric between two policies on the same seeds, with its 95 % interval.

    Raises:
        ValueError: the tables have different seeds.
    """
    if not np.array_equal(episodes["seed"], reference["seed"]):
        raise ValueError("paired_difference: the two tables must have the same seeds in the same order")
    difference = episodes[metric].to_numpy(float) - reference[metric].to_numpy(float)
    return (float(difference.mean()), *bootstrap_interval(difference))
