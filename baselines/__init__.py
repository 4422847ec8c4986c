"""Classical guidance and control policies, and the report about them."""

from typing import TYPE_CHECKING

from formation_env.lazy import lazy_names

if TYPE_CHECKING:
    from baselines.controllers.registry import POLICIES, make_policy, register_policy
    from baselines.design.steady_state_filter import stationary_filter
    from baselines.optimal import OptimalPlan, cost_ratio, fuel_optimal, impulsive_transfer

__distribution__ = "formation-env"
"""Read by the command line: another package of this name has another `__init__.py`."""

__getattr__ = lazy_names(
    __name__,
    {
        "POLICIES": "baselines.controllers.registry",
        "OptimalPlan": "baselines.optimal",
        "cost_ratio": "baselines.optimal",
        "fuel_optimal": "baselines.optimal",
        "impulsive_transfer": "baselines.optimal",
        "make_policy": "baselines.controllers.registry",
        "register_policy": "baselines.controllers.registry",
        "stationary_filter": "baselines.design.steady_state_filter",
    },
)

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
