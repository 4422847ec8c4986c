"""Policies as data: made where they are flown, in other processes, too."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import PLANNING, POLICIES, SOLVER, gains_path, make_policy, policy_class, read_gains
from formation_env.evaluation.rollout import Policy
from formation_env.task.scenario import Scenario


class PolicyFactory(Protocol):
    """Makes a fresh policy. To fly in several processes it must be importable, so no lambda.

    A factory may have a method `settings(original)` that gives all that its policy depends on, as a dataclass or as
    plain data, or None if it has no policy. Then the report shows them, and its flights can be kept.
    """

    def __call__(self, original: Scenario, believed: Scenario, /) -> Policy | None:
        """A policy for the scenario that it is told of, or None if there is none.

        Args:
            original: the scenario whose gains or training it has.
            believed: the one it is told of; another than the original only where that is varied.
        """
        ...


@dataclass(frozen=True)
class Classical:
    """A policy of `POLICIES`, with the gains of the original scenario.

    Attributes:
        name: of the policy.

    Raises:
        ConfigError: there is none of that name.
    """

    name: str

    def __post_init__(self) -> None:
        policy_class(self.name)

    def __call__(self, original: Scenario, believed: Scenario) -> AccelerationPolicy:
        """The policy for the believed scenario."""
        return make_policy(self.name, believed, self.settings(original))

    def settings(self, original: Scenario) -> Any:
        """Its gains.

        Raises:
            ConfigError: the gain file is wrong.
        """
        return _gains(self.name, gains_path(original))


def classical(names: Sequence[str] = ()) -> dict[str, Classical]:
    """Factories of classical policies, each once.

    Args:
        names: of the policies; by default all, but for those that plan where their solver is not installed.

    Raises:
        ConfigError: there is none of a name.
    """
    chosen = names or [name for name in POLICIES if name not in PLANNING or find_spec(SOLVER)]
    return {name: Classical(name) for name in chosen}


@lru_cache
def _gains(name: str, path: Path) -> Any:
    """A policy's settings from a gain file, which is read once."""
    return read_gains(name, path)


def describe(factory: PolicyFactory, original: Scenario) -> Any:
    """A factory's settings for a scenario as plain data; None if it does not tell them."""
    tell = getattr(factory, "settings", None)
    found = None if tell is None else tell(original)
    return asdict(found) if is_dataclass(found) and not isinstance(found, type) else found
