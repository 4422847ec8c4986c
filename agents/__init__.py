"""Reinforcement learning: training, trained policies, and the report with learned and classical ones side by side."""

from agents.runs import LearnedPolicy, load_policy

__all__ = ["LearnedPolicy", "load_policy"]
