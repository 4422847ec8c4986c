"""Comparison of policies: every policy on every environment with the same seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from baselines.experiments.episodes import ACTION_TIME, Episodes, Flight
from baselines.experiments.policy_factories import describe
from formation_env.settings import ConfigError
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Environment = str | Path | Scenario
"""A registered id, a scenario's name or path, or a Scenario."""


@dataclass(frozen=True)
class Flown:
    """Episodes of all policies on one environment.

    Attributes:
        label: name of the environment in the report.
        scenario: the environment.
        episodes: policy -> table of `formation_env.evaluation.evaluate`; shorter tables have the first ones of the
            longest's seeds.
        flight_seed: seed of the episode shown in full.
        flights: policy -> table of `formation_env.evaluation.record`, with the column `ACTION_TIME`.
        settings: policy -> its own settings as plain data, where it gives them.
    """

    label: str
    scenario: Scenario
    episodes: dict[str, pd.DataFrame]
    flight_seed: int
    flights: dict[str, pd.DataFrame]
    settings: dict[str, Any]

    def action_time_us(self, policy: str) -> float:
        """Median time per action in the episode shown in full, microseconds."""
        return float(self.flights[policy][ACTION_TIME].median())


def name_environments(envs: Sequence[Environment]) -> dict[str, Scenario]:
    """The scenarios by their labels: the id or name as given, a path's stem, or a Scenario's title.

    Raises:
        ConfigError: no environment, two of the same label, or a faulty scenario.
    """
    named: dict[str, Scenario] = {}
    for env in envs:
        scenario = load_scenario(env)
        path = Path(env) if not isinstance(env, Scenario) else None
        label = scenario.title or "scenario" if path is None else path.stem if path.suffix else str(env)
        if label in named:
            raise ConfigError(f"report: two environments are called {label!r}; name each once")
        named[label] = scenario
    if not named:
        raise ConfigError("report: no environment to fly")
    return named


def join_episodes(
    jobs: Mapping[tuple[str, str, int], Episodes], results: Mapping[Any, pd.DataFrame | None]
) -> dict[str, dict[str, pd.DataFrame]]:
    """Environment -> policy -> its episodes, in the order of their seeds.

    Args:
        jobs: that were run.
        results: their tables by the same names.

    Raises:
        ConfigError: an environment without any policy.
    """
    parts: dict[str, dict[str, list[pd.DataFrame]]] = {env: {} for env, _, _ in jobs}
    for env, policy, first in jobs:
        table = results[env, policy, first]
        if table is not None:
            parts[env].setdefault(policy, []).append(table)
    for env, policies in parts.items():
        if not policies:
            raise ConfigError(f"report: no policy for {env}")
    return {
        env: {policy: pd.concat(tables, ignore_index=True) for policy, tables in policies.items()}
        for env, policies in parts.items()
    }


def flight_jobs(
    jobs: Mapping[tuple[str, str, int], Episodes], episodes: Mapping[str, Mapping[str, pd.DataFrame]]
) -> dict[tuple[str, str], Flight]:
    """One episode of each policy on a typical seed of its environment, by environment and policy.

    Args:
        jobs: that were run.
        episodes: their results, see `join_episodes`.
    """
    seeds = {env: typical_seed(tables) for env, tables in episodes.items()}
    return {
        (env, policy): Flight(job.scenario, policy, job.factory, seeds[env], job.slow)
        for (env, policy, _), job in jobs.items()
        if policy in episodes[env]
    }


def typical_seed(episodes: Mapping[str, pd.DataFrame]) -> int:
    """A seed in the middle fifth of the best policy's returns, with the most typical share of lost measurements."""
    best = max(episodes.values(), key=lambda table: table["return"].mean()).sort_values("return")
    middle = best.iloc[2 * len(best) // 5 : 3 * len(best) // 5 + 1]
    far = (middle["measurements_lost"] - best["measurements_lost"].mean()).abs()
    return int(middle["seed"].to_numpy()[far.to_numpy(float).argmin()])


def join_flights(
    scenarios: Mapping[str, Scenario],
    episodes: Mapping[str, dict[str, pd.DataFrame]],
    jobs: Mapping[tuple[str, str], Flight],
    results: Mapping[Any, pd.DataFrame],
) -> list[Flown]:
    """Join episodes, recorded flights and settings of each environment.

    Args:
        scenarios: by environment.
        episodes: by environment and policy.
        jobs: the recorded episodes.
        results: their tables by the same names.
    """
    joined = []
    for env, scenario in scenarios.items():
        own = {policy: job for (place, policy), job in jobs.items() if place == env}
        flights = {policy: results[env, policy] for policy in own}
        described = {policy: describe(job.factory, scenario) for policy, job in own.items()}
        settings = {policy: values for policy, values in described.items() if values is not None}
        seed = next(iter(own.values())).seed
        joined.append(Flown(env, scenario, episodes[env], seed, flights, settings))
    return joined
