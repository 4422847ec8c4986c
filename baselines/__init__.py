"""Classical guidance and control policies, and the report about them."""

from baselines.controllers.registry import POLICIES, make_policy, register_policy
from baselines.design.steady_state_filter import stationary_filter
from baselines.optimal import OptimalPlan, cost_ratio, fuel_optimal, impulsive_transfer

__all__ = [
    "POLICIES",
    "OptimalPlan",
    "cost_ratio",
    "fuel_optimal",
    "impulsive_transfer",
    "make_policy",
    "register_policy",
    "stationary_filter",
]
