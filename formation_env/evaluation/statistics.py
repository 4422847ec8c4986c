"""Statistics over episodes: means with 95 % intervals, and paired differences."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from formation_env.kernel.metrics import METRICS


def bootstrap_interval(values: NDArray[np.float64], confidence: float = 0.95) -> tuple[float, float]:
    """Confidence interval of the mean of values (n,) by the bias-corrected bootstrap; the same data give the same."""
    values = np.asarray(values, float)
    if len(values) < 2 or np.ptp(values) <= 1e-12 * abs(values.mean()):
        return float(values.mean()), float(values.mean())
    result = stats.bootstrap((values,), np.mean, confidence_level=confidence, rng=np.random.default_rng(0))
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def summarise(episodes: pd.DataFrame) -> pd.DataFrame:
    """Mean and 95 % interval of each metric of `evaluate`'s table: index metric, columns mean, low, high."""
    rows = {}
    for name in METRICS:
        values = episodes[name].to_numpy(float)
        rows[name] = (values.mean(), *bootstrap_interval(values))
    return pd.DataFrame.from_dict(rows, orient="index", columns=["mean", "low", "high"])


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
