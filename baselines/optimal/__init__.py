"""Perfect-information lower bounds on an episode's cost, and the cone programs behind them and behind `mpc`."""

from baselines.optimal.cost_ratio import CostRatio, cost_ratio
from baselines.optimal.impulsive import ImpulsivePlan, impulsive_transfer
from baselines.optimal.lower_bound import OptimalPlan, fuel_optimal

__all__ = ["CostRatio", "ImpulsivePlan", "OptimalPlan", "cost_ratio", "fuel_optimal", "impulsive_transfer"]
