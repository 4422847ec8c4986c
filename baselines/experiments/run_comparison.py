"""All that a report flies, in two rounds: what the second flies depends on the first."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from baselines.experiments import parallel
from baselines.experiments.bound_jobs import Bounds, bound_jobs
from baselines.experiments.comparison import Flown, flight_jobs, join_episodes, join_flights
from baselines.experiments.effort import Wanted
from baselines.experiments.episodes import episode_jobs
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.result_cache import FOLDER, keep
from baselines.experiments.sweep import Point, Sweep, points
from baselines.optimal.cone_solver import SOLVER
from formation_env.evaluation.seeds import seeds
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario

Scenarios = Mapping[str, Scenario]
Policies = Mapping[str, PolicyFactory]


@dataclass(frozen=True)
class Found:
    """What was flown.

    Attributes:
        flown: the environments.
        bounds: least cost of each seed (seeds,), m/s, by environment; those with a nonlinear truth have none.
        sweep: fronts and robustness.
    """

    flown: list[Flown]
    bounds: dict[str, Array]
    sweep: Sweep


def fly(policies: Policies, scenarios: Scenarios, wanted: Wanted, out: Path, workers: int) -> Found:
    """Fly all policies on all environments, with a progress bar for each round.

    Args:
        policies: label -> factory.
        scenarios: label -> environment.
        wanted: how much to fly.
        out: the report's folder.
        workers: processes.

    Raises:
        ConfigError: a faulty policy, or an environment without any.
        ValueError: no or too many episodes.
        RuntimeError: the bound's solver failed.
        OSError: the folder cannot be written.
    """
    folder, all_seeds = out / FOLDER if wanted.resume else None, seeds("test", wanted.episodes)
    slow = dict.fromkeys(wanted.slow, wanted.slow_episodes)
    flights = {}
    for env, scenario in scenarios.items():
        flights |= episode_jobs(policies, env, scenario, all_seeds, slow)
    solved = bound_jobs(scenarios, all_seeds, out)
    first = parallel.fly({**keep(flights, folder), **solved}, workers)
    episodes = join_episodes(flights, first)
    shown = flight_jobs(flights, episodes)
    crews = {env: _swept(policies, tables, wanted) for env, tables in episodes.items()}
    varied, faults = _points(scenarios, crews, wanted)
    second = parallel.fly({**keep(shown, folder), **keep(varied, folder)}, workers)
    sweep = Sweep.join([second[name] for name in varied], faults)
    return Found(join_flights(scenarios, episodes, shown, second), _join_bounds(solved, first), sweep)


def _join_bounds(solved: Mapping[tuple[str, int], Bounds], found: Mapping[Any, Array]) -> dict[str, Array]:
    parts: dict[str, list[Array]] = {}
    for env, first in solved:
        parts.setdefault(env, []).append(found[env, first])
    return {env: np.concatenate(costs) for env, costs in parts.items()}


def _swept(policies: Policies, flown: Mapping[str, pd.DataFrame], wanted: Wanted) -> dict[str, PolicyFactory]:
    """The policies of an environment's fronts."""
    return {name: policies[name] for name in flown if name not in wanted.unswept}


def _points(
    scenarios: Scenarios, crews: Mapping[str, Policies], wanted: Wanted
) -> tuple[dict[str, Point], dict[str, str]]:
    """What fronts and robustness fly, and why an environment has none."""
    made: dict[str, Point] = {}
    faults: dict[str, str] = {}
    bound_episodes = wanted.sweep_bound_episodes if find_spec(SOLVER) else 0
    for env, crew in crews.items() if wanted.sweep_episodes else ():
        own = seeds("test", wanted.sweep_episodes)
        try:
            made |= points({env: scenarios[env]}, crew, own, bound_episodes, wanted.coarse) if crew else {}
        except ConfigError as error:
            faults[env] = str(error)
    return made, faults
