"""Rollouts of policies on given seeds, and their statistics."""

from formation_env.evaluation.rollout import Policy, evaluate, record
from formation_env.evaluation.statistics import bootstrap_interval, paired_difference, summarise

__all__ = ["Policy", "bootstrap_interval", "evaluate", "paired_difference", "record", "summarise"]
