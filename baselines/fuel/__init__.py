"""The least that an episode can cost, known all its noises: the yardstick of every policy."""

from baselines.fuel.impulsive import ImpulsivePlan, impulsive_transfer
from baselines.fuel.optimum import OptimalPlan, fuel_optimal
from baselines.fuel.regret import Regret, regret

__all__ = ["ImpulsivePlan", "OptimalPlan", "Regret", "fuel_optimal", "impulsive_transfer", "regret"]
