"""Ratio of a policy's cost to the perfect-information lower bound."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array


@dataclass(frozen=True)
class CostRatio:
    """Cost over bound.

    Attributes:
        ratios: of each seed (seeds,); 1 is the optimum.
        mean: of the ratios.
        low: lower end of the mean's 95 % interval.
        high: its upper end.
    """

    ratios: Array
    mean: float
    low: float
    high: float


def cost_ratio(costs: ArrayLike, bounds: ArrayLike) -> CostRatio:
    """The cost ratio on each seed, with the mean and its bootstrap interval.

    Args:
        costs: of a policy (seeds,), minus its returns, m/s.
        bounds: the least costs on the same seeds (seeds,), `OptimalPlan.cost`, m/s.

    Raises:
        ValueError: unequal or empty shapes, or a bound that is not positive.
    """
    above, below = np.asarray(costs, float), np.asarray(bounds, float)
    if above.shape != below.shape or above.ndim != 1 or above.size == 0:
        raise ValueError(
            f"cost_ratio: costs and bounds must have one shape (seeds,), got {above.shape} and {below.shape}"
        )
    if not (below > 0).all():
        seed = int(np.argmin(below > 0))
        raise ValueError(f"bounds: must be > 0, got {below[seed]:g} in place {seed}")
    ratios = above / below
    return CostRatio(ratios, float(ratios.mean()), *bootstrap_interval(ratios))
