"""Episodes of several followers: cost, delta-v, violations and least distance of each group."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, Protocol

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode
from scipy.stats import binomtest

from formation_env import FormationSwarmVectorEnv
from formation_env.dropout import GilbertElliott
from formation_env.task.scenario import Scenario

MOST_GROUPS: Final = 256
"""Groups that are flown side by side."""


class SwarmFlyer(Protocol):
    """Whatever flies groups, see `baselines.swarm.policy.SwarmPolicy`."""

    def predict(self, observation: Any) -> tuple[Any, Any]:
        """Actions (groups, followers, 3) for observations (groups, followers, size)."""


def fly_groups(policy: SwarmFlyer, scenario: Scenario, seeds: Sequence[int]) -> pd.DataFrame:
    """Fly an episode of a group for each seed.

    Args:
        policy: flies them.
        scenario: of several followers.
        seeds: of the episodes.

    Returns:
        One line per episode: `seed`; `cost_m_s` and `delta_v_m_s`, means over followers; `violating_steps`, summed over
        followers; `least_distance_m`; `violated`, `collided`.
    """
    parts = [seeds[first : first + MOST_GROUPS] for first in range(0, len(seeds), MOST_GROUPS)]
    return pd.concat([_fly(policy, scenario, part) for part in parts], ignore_index=True)


def _fly(policy: SwarmFlyer, scenario: Scenario, seeds: Sequence[int]) -> pd.DataFrame:
    env = FormationSwarmVectorEnv(len(seeds), scenario, autoreset_mode=AutoresetMode.NEXT_STEP)
    observations, _ = env.reset(seed=[*seeds])
    totals: dict[str, Any] = {name: np.full((len(seeds), scenario.followers), np.nan) for name in _TOTALS}
    left = np.ones(len(seeds), bool)
    while left.any():
        observations, _, _, _, infos = env.step(policy.predict(observations)[0])
        ended = infos["_episode_totals"] & left if "episode_totals" in infos else np.zeros(len(seeds), bool)
        for name, values in totals.items():
            if ended.any():
                values[ended] = infos["episode_totals"][name][ended]
        left &= ~ended
    return pd.DataFrame(
        {
            "seed": list(seeds),
            "cost_m_s": -totals["return"].mean(axis=1),
            "delta_v_m_s": totals["delta_v_m_s"].mean(axis=1),
            "violating_steps": totals["cost"].sum(axis=1),
            "least_distance_m": totals["least_distance_m"].min(axis=1),
            "violated": totals["cost"].sum(axis=1) > 0,
            "collided": totals["least_distance_m"].min(axis=1) < scenario.safety.collision_distance_m,
        }
    )


_TOTALS: Final = ("return", "delta_v_m_s", "cost", "least_distance_m")


def per_thousand(happened: pd.Series) -> tuple[float, float, float]:
    """Episodes in a thousand in which something happened, with its exact 95 % interval (Clopper & Pearson 1934)."""
    count, episodes = int(happened.sum()), len(happened)
    interval = binomtest(count, episodes).proportion_ci(0.95, method="exact")
    return 1000 * count / episodes, 1000 * float(interval.low), 1000 * float(interval.high)


def with_outages(scenario: Scenario, mean_outage_s: float) -> Scenario:
    """The scenario with links between followers whose outages last so long on average, as often as one in an orbit."""
    dropout = GilbertElliott(mean_outage_s=mean_outage_s, mean_uptime_orbits=1.0)
    return replace(scenario, inter_satellite_link=replace(scenario.inter_satellite_link, dropout=dropout))
