"""Reinforcement learning: training, trained policies, and the report with learned and classical ones side by side."""

from typing import TYPE_CHECKING

from formation_env.lazy import lazy_names

if TYPE_CHECKING:
    from agents.policy.actor import Actor
    from agents.policy.library import load_policy

__distribution__ = "formation-env"
"""Read by the command line: another package of this name has another `__init__.py`."""

__getattr__ = lazy_names(__name__, {"Actor": "agents.policy.actor", "load_policy": "agents.policy.library"})

__all__ = ["Actor", "load_policy"]
