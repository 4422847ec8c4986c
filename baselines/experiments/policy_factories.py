"""Policy factories: picklable, so that worker processes make their own policies."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from baselines import result_cache
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import PLANNING, POLICIES, SOLVER, gains_path, make_policy, policy_class, read_gains
from formation_env.evaluation.rollout import Policy
from formation_env.task.scenario import Scenario


class PolicyFactory(Protocol):
    """Makes a fresh policy. To fly in several processes it must be importable, so no lambda.

    A factory may have a method `settings(original)` that returns all that its policy depends on, as a dataclass or as
    plain data, or None if it has no policy. Then the report shows them, and its episodes can be cached.
    """

    def __call__(self, original: Scenario, believed: Scenario, /) -> Policy | None:
        """A policy designed for the believed scenario, or None if there is none.

        Args:
            original: the scenario whose settings or training the policy has.
            believed: the scenario it is designed for; it differs from the original only in a sweep.
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
    """Factories of classical policies.

    Args:
        names: of the policies; by default all, without those whose solver is not installed.

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
    """A factory's settings for a scenario as plain data; None if it does not give them."""
    settings = getattr(factory, "settings", None)
    found = None if settings is None else settings(original)
    return asdict(found) if is_dataclass(found) and not isinstance(found, type) else found


def cache_key(factory: PolicyFactory, original: Scenario) -> Any:
    """All that a factory's policy depends on: its settings and its code; None if it does not give its settings."""
    settings = describe(factory, original)
    module = getattr(factory, "__module__", type(factory).__module__)
    return None if settings is None else (settings, _module_hash(module))


@cache
def _module_hash(module: str) -> str:
    """Hash of the sources of a module's package, or of the module itself if it is in none."""
    package = sys.modules.get(module.partition(".")[0])
    if package is not None and getattr(package, "__path__", None):
        return result_cache.hash_sources(path for root in package.__path__ for path in sorted(Path(root).rglob("*.py")))
    file = getattr(sys.modules.get(module), "__file__", None)
    return "" if file is None else result_cache.hash_sources([Path(file)])
