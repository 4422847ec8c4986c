"""The least that an episode can cost, known all its noises: the yardstick of every policy."""

from baselines.optimal.cost_ratio import CostRatio, cost_ratio
from baselines.optimal.impulsive import ImpulsivePlan, impulsive_transfer
from baselines.optimal.lower_bound import OptimalPlan, fuel_optimal

__all__ = ["CostRatio", "ImpulsivePlan", "OptimalPlan", "cost_ratio", "fuel_optimal", "impulsive_transfer"]
