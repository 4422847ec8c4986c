"""Tables of several followers: what architectures and avoidance cost, and what they spare."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pandas as pd

from baselines.experiments.swarm_episodes import fly_groups, per_thousand, with_outages
from baselines.report.table import Cell, Quantity, Table, Tables
from baselines.swarm.architectures import ARCHITECTURES
from baselines.swarm.avoidance import AVOIDANCE
from baselines.swarm.registry import NO_AVOIDANCE, make_swarm_policy
from baselines.swarm.scp import Scp
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.registration import SWARM_IDS
from formation_env.task.loading import load_scenario

PLAIN: Final = next(iter(ARCHITECTURES))
POLICIES: Final = (
    *((name, NO_AVOIDANCE) for name in ARCHITECTURES),
    *((PLAIN, name) for name in AVOIDANCE),
)
"""Architecture and avoidance of each line."""
SCP: Final = (Scp.name, NO_AVOIDANCE)
"""The centralised plan: seconds for each episode, so that only those who ask for it fly it."""
LAYERS: Final = tuple((PLAIN, name) for name in (NO_AVOIDANCE, *AVOIDANCE))
COLUMNS: Final = (
    "environment",
    "architecture",
    "avoidance",
    "cost, m/s per follower",
    "delta-v, m/s",
    "more than without avoidance, m/s",
    "more than scp, m/s",
    "episodes with a violation, per 1000",
    "with a collision, per 1000",
    "least distance, m",
)
NOTE: Final = (
    "All lines of an environment fly the same seeds. A violation is a step with info['cost'] = 1 of any follower; a "
    "collision ends the group's episode, and costs as much as staying at the distance limit to the end. Means with "
    "95 % bootstrap intervals, differences of delta-v paired by seed; rates with exact ones (Clopper-Pearson)."
)


def swarm_table(envs: Sequence[str], episodes: int, policies: Sequence[tuple[str, str]] = POLICIES) -> Table:
    """Fly the policies for several followers on the test seeds.

    Args:
        envs: registered ids, names or paths of scenarios of several followers.
        episodes: of each line.
        policies: architecture and avoidance of each line.
    """
    rows = [row for env in envs for row in _rows(env, flights(env, episodes, policies))]
    return Table("swarms", "Several followers: cost and safety", COLUMNS, tuple(rows), NOTE)


def swarm_tables(episodes: int) -> Tables:
    """What a report shows of the registered environments of several followers."""
    return lambda results: [swarm_table(tuple(SWARM_IDS), episodes)]


def outage_table(
    envs: Sequence[str], episodes: int, outages_s: Sequence[float], policies: Sequence[tuple[str, str]] = LAYERS
) -> Table:
    """The same for the layers of avoidance, with links between followers whose outages grow."""
    rows = [
        row
        for env in envs
        for outage_s in outages_s
        for row in _rows(f"{env}, outages of {outage_s:g} s", flights(env, episodes, policies, outage_s))
    ]
    return Table("swarm_outages", "Avoidance under outages of the links between followers", COLUMNS, tuple(rows), NOTE)


def flights(
    env: str, episodes: int, policies: Sequence[tuple[str, str]], outage_s: float | None = None
) -> dict[tuple[str, str], pd.DataFrame]:
    """Episodes of each policy, see `fly_groups`; `outage_s` as of `with_outages`."""
    scenario = load_scenario(env)
    flown = scenario if outage_s is None else with_outages(scenario, outage_s)
    flown_seeds = seeds("test", episodes)
    return {each: fly_groups(make_swarm_policy(each[0], flown, each[1]), flown, flown_seeds) for each in policies}


def _rows(label: str, flown: Mapping[tuple[str, str], pd.DataFrame]) -> list[tuple[Cell, ...]]:
    plain, best = flown.get((PLAIN, NO_AVOIDANCE)), flown.get(SCP)
    rows: list[tuple[Cell, ...]] = []
    for (architecture, avoidance), episodes in flown.items():
        over_plain = None if avoidance == NO_AVOIDANCE else plain
        over_best = None if (architecture, avoidance) == SCP else best
        rows.append(
            (
                label,
                architecture,
                avoidance,
                _mean(episodes["cost_m_s"]),
                _mean(episodes["delta_v_m_s"]),
                _more(episodes, over_plain),
                _more(episodes, over_best),
                Quantity(per_thousand(episodes["violated"]), len(episodes)),
                Quantity(per_thousand(episodes["collided"]), len(episodes)),
                round(float(episodes["least_distance_m"].min()), 1),
            )
        )
    return rows


def _more(episodes: pd.DataFrame, reference: pd.DataFrame | None) -> Cell:
    """Delta-v beyond that of another policy on the same seeds."""
    return None if reference is None else _mean(episodes["delta_v_m_s"] - reference["delta_v_m_s"])


def _mean(values: pd.Series) -> Quantity:
    low, high = bootstrap_interval(values.to_numpy(float))
    return Quantity((float(np.mean(values)), low, high), len(values))
