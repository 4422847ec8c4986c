"""Reinforcement learning: training, trained policies, and the report with learned and classical ones side by side."""

from agents.actor import Actor
from agents.shipped import load_policy

__all__ = ["Actor", "load_policy"]
