"""Reinforcement learning: training, trained policies, and the report with learned and classical ones side by side."""

from agents.policy.actor import Actor
from agents.policy.library import load_policy

__all__ = ["Actor", "load_policy"]
