"""Policy factories: picklable, so that worker processes make their own policies."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Protocol

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import (
    POLICIES,
    make_policy,
    policy_class,
    read_settings,
    settings_beside,
    settings_path,
)
from formation_env.evaluation.rollout import Policy
from formation_env.files import hash_sources
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario


class PolicyFactory(Protocol):
    """Makes a fresh policy. To fly in several processes it must be importable, so no lambda.

    A factory may have a method `settings(original)` that returns all that its policy depends on, as a dataclass or as
    plain data, or None if it has no policy. Then the report shows them, and its episodes can be cached.
    """

    def __call__(self, original: Scenario, design: Scenario, /) -> Policy | None:
        """A policy for the design scenario, or None if there is none.

        Args:
            original: the scenario whose settings or training the policy has.
            design: the scenario it is designed for; it differs from the original only in a sweep.
        """
        ...


@dataclass(frozen=True)
class Classical:
    """A policy of `POLICIES`, with the settings of the original scenario.

    Attributes:
        name: of the policy.
        files: scenarios and their settings files, for those that are read from a user's file.

    Raises:
        ConfigError: there is none of that name.
    """

    name: str
    files: tuple[tuple[Scenario, Path], ...] = ()

    def __post_init__(self) -> None:
        policy_class(self.name)

    def __call__(self, original: Scenario, design: Scenario) -> AccelerationPolicy:
        """The policy for the design scenario."""
        return make_policy(self.name, design, self.settings(original))

    def settings(self, original: Scenario) -> Any:
        """Its settings.

        Raises:
            ConfigError: the settings file is wrong.
        """
        given = next((path for scenario, path in self.files if scenario == original), None)
        return _settings(self.name, given or settings_path(original))


def classical(names: Sequence[str] = (), environments: Sequence[str | Path] = ()) -> dict[str, Classical]:
    """Factories of classical policies.

    Args:
        names: of the policies; by default all whose libraries are installed.
        environments: ids, names or files of the scenarios to fly, so that settings beside a user's file are found.

    Raises:
        ConfigError: there is no policy of a name, or a scenario file is wrong.
    """
    chosen = names or [name for name, policy in POLICIES.items() if policy.is_available()]
    beside = [each for each in environments if (path := settings_beside(each)) is not None and path.is_file()]
    files = tuple((load_scenario(each), settings_path(each)) for each in beside)
    return {name: Classical(name, files) for name in chosen}


@lru_cache
def _settings(name: str, path: Path) -> Any:
    """A policy's settings from a file, which is read once."""
    return read_settings(name, path)


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
        return hash_sources(path for root in package.__path__ for path in sorted(Path(root).rglob("*.py")))
    file = getattr(sys.modules.get(module), "__file__", None)
    return "" if file is None else hash_sources([Path(file)])
