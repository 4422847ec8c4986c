"""All episodes of a report, in two rounds: the second round depends on the results of the first."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from baselines.experiments import parallel
from baselines.experiments.bound_jobs import Bounds, bound_jobs
from baselines.experiments.cached_jobs import FOLDER, cached
from baselines.experiments.comparison import Flown, flight_jobs, join_episodes, join_flights
from baselines.experiments.effort import ReportOptions
from baselines.experiments.episodes import Episodes, episode_jobs
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.sweep import Point, Sweep, points
from baselines.optimal.cone_solver import SOLVER
from formation_env.evaluation.seeds import seeds
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario

Scenarios = Mapping[str, Scenario]
Policies = Mapping[str, PolicyFactory]


@dataclass(frozen=True)
class ComparisonData:
    """Raw results of a comparison.

    Attributes:
        flown: the environments with their episodes.
        bounds: perfect-information bound of each seed (seeds,), m/s, by environment; none for a nonlinear truth.
        sweep: trade-off and robustness.
    """

    flown: list[Flown]
    bounds: dict[str, Array]
    sweep: Sweep


def run_comparison(
    policies: Policies, scenarios: Scenarios, options: ReportOptions, out: Path, workers: int
) -> ComparisonData:
    """Fly all policies on all environments, with a progress bar for each round.

    Args:
        policies: label -> factory.
        scenarios: label -> environment.
        options: effort.
        out: the report's folder.
        workers: processes.

    Raises:
        ConfigError: a faulty policy, or an environment without any.
        ValueError: no or too many episodes.
        RuntimeError: the bound's solver failed, or a worker process died.
        OSError: the folder cannot be written.
    """
    folder, all_seeds = out / FOLDER if options.resume else None, seeds("test", options.episodes)
    slow = dict.fromkeys(options.slow, options.slow_episodes)
    flights: dict[tuple[str, str, int], Episodes] = {}
    for env, scenario in scenarios.items():
        flights |= episode_jobs(policies, env, scenario, all_seeds, slow)
    bounds = bound_jobs(scenarios, all_seeds, out)
    first = parallel.run_with_bar({**cached(flights, folder), **bounds}, workers, "episodes and bounds (1 of 2)")
    episodes = join_episodes(flights, first)
    shown = flight_jobs(flights, episodes)
    swept = {env: _swept(policies, tables, options) for env, tables in episodes.items()}
    varied, faults = _points(scenarios, swept, options)
    second = parallel.run_with_bar({**cached(shown, folder), **cached(varied, folder)}, workers, "sweeps (2 of 2)")
    sweep = Sweep.join([second[name] for name in varied], faults)
    return ComparisonData(join_flights(scenarios, episodes, shown, second), _join_bounds(bounds, first), sweep)


def _join_bounds(jobs: Mapping[tuple[str, str, int], Bounds], results: Mapping[Any, Array]) -> dict[str, Array]:
    parts: dict[str, list[Array]] = {}
    for name in jobs:
        parts.setdefault(name[0], []).append(results[name])
    return {env: np.concatenate(costs) for env, costs in parts.items()}


def _swept(policies: Policies, tables: Mapping[str, pd.DataFrame], options: ReportOptions) -> dict[str, PolicyFactory]:
    """The policies of an environment's sweep."""
    return {name: policies[name] for name in tables if name not in options.unswept}


def _points(
    scenarios: Scenarios, swept: Mapping[str, Policies], options: ReportOptions
) -> tuple[dict[str, Point], dict[str, str]]:
    """Jobs of trade-off and robustness, and the reason where an environment has none."""
    jobs: dict[str, Point] = {}
    faults: dict[str, str] = {}
    bound_episodes = options.sweep_bound_episodes if find_spec(SOLVER) else 0
    for env, policies in swept.items() if options.sweep_episodes else ():
        own = seeds("test", options.sweep_episodes)
        try:
            jobs |= points({env: scenarios[env]}, policies, own, bound_episodes, options.coarse) if policies else {}
        except ConfigError as error:
            faults[env] = str(error)
    return jobs, faults
