"""Classical guidance and control policies, and the report about them."""

from baselines.fuel import OptimalPlan, fuel_optimal, impulsive_transfer, regret
from baselines.kalman import stationary_filter
from baselines.registry import POLICIES, make_policy

__all__ = [
    "POLICIES",
    "OptimalPlan",
    "fuel_optimal",
    "impulsive_transfer",
    "make_policy",
    "regret",
    "stationary_filter",
]
