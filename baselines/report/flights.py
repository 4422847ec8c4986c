"""What the report is about: every policy flown on every environment with the same seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from tqdm import tqdm

from formation_env.evaluation import Policy, evaluate, record, scenario_of
from formation_env.scenario import Scenario
from formation_env.settings import ConfigError

PolicyFactory = Callable[[Scenario], Policy | None]
"""Makes a fresh policy for a scenario, or None if it has none for it."""
Environment = str | Path | Scenario
"""A registered id, a scenario's name or path, or a Scenario."""


@dataclass(frozen=True)
class Flown:
    """One environment, flown.

    Attributes:
        label: name of the environment in the report.
        scenario: its settings.
        episodes: policy -> table of `formation_env.evaluation.evaluate`.
        flight_seed: seed of the flights shown in full.
        flights: policy -> table of `formation_env.evaluation.record`.
        settings: policy -> its own settings as plain data, where it tells them.
    """

    label: str
    scenario: Scenario
    episodes: dict[str, pd.DataFrame]
    flight_seed: int
    flights: dict[str, pd.DataFrame]
    settings: dict[str, Any]


def name_environments(envs: Sequence[Environment]) -> dict[str, Scenario]:
    """The scenarios by their labels: the id or name as given, a path's stem, or a Scenario's title.

    Raises:
        ConfigError: no environment, two of the same label, or a faulty scenario.
    """
    named: dict[str, Scenario] = {}
    for env in envs:
        scenario = scenario_of(env)
        path = Path(env) if not isinstance(env, Scenario) else None
        label = scenario.title or "scenario" if path is None else path.stem if path.suffix else str(env)
        if label in named:
            raise ConfigError(f"report: two environments are called {label!r}; name each once")
        named[label] = scenario
    if not named:
        raise ConfigError("report: no environment to fly")
    return named


def fly(policies: Mapping[str, PolicyFactory], envs: Sequence[Environment], seeds: Sequence[int]) -> list[Flown]:
    """Fly all policies on all environments, with a progress bar.

    Args:
        policies: label -> factory.
        envs: what to fly.
        seeds: one episode each, the same for all.

    Raises:
        ConfigError: a faulty environment or policy, or an environment without any policy.
    """
    named = name_environments(envs)
    crews = {label: _crew(policies, label, scenario) for label, scenario in named.items()}
    total = sum(named[label].num_steps * (len(seeds) + 1) * len(crew) for label, crew in crews.items())
    first = "flying (the very first run compiles the kernel)"
    with tqdm(total=total, desc=first, unit="step", unit_scale=True, smoothing=0.1, dynamic_ncols=True) as bar:
        return [_fly_one(label, named[label], crew, seeds, bar) for label, crew in crews.items()]


def _crew(policies: Mapping[str, PolicyFactory], label: str, scenario: Scenario) -> dict[str, Policy]:
    """The policies that fly a scenario."""
    made = {name: factory(scenario) for name, factory in policies.items()}
    crew = {name: policy for name, policy in made.items() if policy is not None}
    if not crew:
        raise ConfigError(f"report: no policy for {label}")
    return crew


def _fly_one(
    label: str,
    scenario: Scenario,
    crew: Mapping[str, Policy],
    seeds: Sequence[int],
    bar: "tqdm[Any]",
) -> Flown:
    """All episodes of an environment, then one flight of each policy on a typical seed."""
    episodes = {}
    for name, policy in crew.items():
        flown_before, expected = bar.n, scenario.num_steps * len(seeds)
        episodes[name] = evaluate(policy, scenario, seeds, lambda n, name=name: _advance(bar, f"{label}: {name}", n))
        bar.update(flown_before + expected - bar.n)  # episodes that ended early
    seed = _typical_seed(episodes)
    flights = {}
    for name, policy in crew.items():
        flights[name] = record(policy, scenario, seed)
        bar.update(scenario.num_steps)
    settings = {name: described for name, policy in crew.items() if (described := describe(policy)) is not None}
    return Flown(label, scenario, episodes, seed, flights, settings)


def _advance(bar: "tqdm[Any]", text: str, steps: int) -> None:
    bar.set_description(text, refresh=False)
    bar.update(steps)


def _typical_seed(episodes: Mapping[str, pd.DataFrame]) -> int:
    """A seed of the middle fifth of the best policy's returns: the one that lost nearest to the mean share of data."""
    best = max(episodes.values(), key=lambda table: table["return"].mean()).sort_values("return")
    middle = best.iloc[2 * len(best) // 5 : 3 * len(best) // 5 + 1]
    far = (middle["measurements_lost"] - best["measurements_lost"].mean()).abs()
    return int(middle["seed"].loc[far.idxmin()])


def describe(policy: Policy) -> Any:
    """A policy's settings as plain data: its attribute `gains`, if that is a settings object."""
    gains = getattr(policy, "gains", None)
    return asdict(gains) if is_dataclass(gains) and not isinstance(gains, type) else None
