"""The algorithms' search spaces (`CommonSettings.search_space`) in the terms of `baselines.tuning`."""

from dataclasses import asdict

from agents.hyperparameters import CommonSettings
from baselines.controllers.search_space import Parameter
from baselines.tuning import search_space as mechanics
from formation_env.settings import build


def search_space(algorithm: type[CommonSettings]) -> tuple[Parameter, ...]:
    """Searched hyperparameters of an algorithm with their limits."""
    return tuple(
        Parameter((name,), limits.low, limits.high, log=limits.log) for name, limits in algorithm.search_space.items()
    )


def current_values(agent: CommonSettings) -> dict[str, float]:
    """Values of the searched hyperparameters by name, clipped to their limits."""
    dimensions = search_space(type(agent))
    values = mechanics.current_values(asdict(agent), dimensions)
    return {dimension.name: min(max(values[dimension.name], dimension.low), dimension.high) for dimension in dimensions}


def apply(agent: CommonSettings, values: dict[str, float]) -> CommonSettings:
    """Hyperparameters with searched values by name, rounded to three digits."""
    return build(type(agent), mechanics.apply(asdict(agent), search_space(type(agent)), values), "tune")
