"""Rollouts of a policy: metrics of one episode per seed, and all instants of a single flight."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import pandas as pd

from formation_env.envs import info_keys
from formation_env.envs.vector import FormationVectorEnv
from formation_env.kernel.metrics import METRICS
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

MAX_ROWS: Final = 4096
"""Episodes stepped side by side; more seeds are flown in several batches."""


class Policy(Protocol):
    """A policy with the `predict` method of Stable-Baselines3."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Actions (..., 3) for observations (..., SIZE), and the policy's state."""
        ...


def evaluate(
    policy: Policy,
    env_id_or_scenario: str | Path | Scenario,
    seeds: Sequence[int],
    progress: Callable[[int], Any] = lambda steps: None,
) -> pd.DataFrame:
    """Fly one episode per seed on the batched environment.

    Args:
        policy: chooses the actions, deterministically; its `state` may be of any type.
        env_id_or_scenario: a registered id, a scenario's name or path, or a Scenario.
        seeds: one per episode; the same seeds give the same starts, noises and dropouts to every policy.
        progress: called with the number of episode-steps flown since the last call.

    Returns:
        One line per episode: `seed` and the columns of `formation_env.kernel.metrics.METRICS`.

    Raises:
        ValueError: no seeds.
    """
    scenario = load_scenario(env_id_or_scenario)
    seeds = [int(seed) for seed in seeds]
    if not seeds:
        raise ValueError("evaluate: seeds must not be empty")
    chunks = [seeds[i : i + MAX_ROWS] for i in range(0, len(seeds), MAX_ROWS)]
    return pd.concat([_fly(policy, scenario, chunk, progress) for chunk in chunks], ignore_index=True)


def _fly(policy: Policy, scenario: Scenario, seeds: list[int], progress: Callable[[int], Any]) -> pd.DataFrame:
    env = FormationVectorEnv(len(seeds), scenario)
    observations, _ = env.reset(seed=seeds)
    table = {name: np.full(len(seeds), np.nan) for name in METRICS}
    open_rows = np.ones(len(seeds), bool)
    state, starts = None, np.ones(len(seeds), bool)
    while open_rows.any():
        actions, state = policy.predict(observations, state=state, episode_start=starts, deterministic=True)
        observations, _, terminations, truncations, infos = env.step(actions)
        starts = terminations | truncations
        closing = starts & open_rows
        if closing.any():
            for name, values in table.items():
                values[closing] = infos["final_info"][info_keys.TOTALS][name][closing]
            open_rows &= ~closing
        progress(len(seeds))
    return pd.DataFrame({"seed": seeds, **table})


def record(policy: Policy, env_id_or_scenario: str | Path | Scenario, seed: int) -> pd.DataFrame:
    """Fly one episode and record every instant.

    Returns:
        One line per instant from the start on: time_s, the true state (x_m, y_m, z_m, vx_m_s, vy_m_s, vz_m_s), its
        estimate (the same with the suffix _estimate), the acceleration of the step that led there (ax_m_s2, ay_m_s2,
        az_m_s2), position_error_m, delta_v_m_s, measured and phase.
    """
    scenario = load_scenario(env_id_or_scenario)
    env = FormationVectorEnv(1, scenario)
    observations, infos = env.reset(seed=seed)
    rows = [_instant(infos)]
    state, starts, ended = None, np.ones(1, bool), False
    while not ended:
        actions, state = policy.predict(observations, state=state, episode_start=starts, deterministic=True)
        observations, _, terminations, truncations, infos = env.step(actions)
        starts = np.zeros(1, bool)
        ended = bool(terminations[0] or truncations[0])
        rows.append(_instant(infos["final_info"] if ended else infos))
    table = pd.DataFrame(rows)
    table.insert(0, "time_s", scenario.dt_s * np.arange(len(table)))
    return table


_STATE_COLUMNS: Final = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")


def _instant(infos: dict[str, Any]) -> dict[str, float]:
    """The first row's infos as a line."""
    line = dict(zip(_STATE_COLUMNS, infos["true_state"][0], strict=True))
    line |= {f"{name}_estimate": x for name, x in zip(_STATE_COLUMNS, infos["estimate"][0], strict=True)}
    line |= dict(zip(("ax_m_s2", "ay_m_s2", "az_m_s2"), infos[info_keys.THRUST][0], strict=True))
    return line | {name: infos[name][0] for name in ("position_error_m", "delta_v_m_s", "measured", "phase")}
