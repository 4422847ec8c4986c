"""Classical guidance and control policies, and the report about them."""

from baselines.kalman import stationary_filter
from baselines.registry import POLICIES, make_policy

__all__ = ["POLICIES", "make_policy", "stationary_filter"]
