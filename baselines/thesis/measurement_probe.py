"""Measurements of an episode, read from the estimate of a filter that trusts only them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from baselines.thesis.recorded_flights import Floats
from formation_env.envs import interface
from formation_env.envs.vector import FormationVectorEnv
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

_POSITION_ONLY_TRUST: Final[dict[str, Any]] = {"process_noise_m_s2": 1.0, "sigma_pos_m": 1e-6, "sigma_vel_m_s": 1e6}
"""Filter settings with which the estimate equals each measured position."""


def with_final_infos(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos of a step; those of ended episodes replace those of the episodes that follow them."""
    finals, ended = infos["final_info"], infos["_final_info"]
    merged = dict(infos)
    for name in ("true_state", "estimate", "measured", interface.INFO_THRUST):
        mask = ended if finals[name].ndim == 1 else ended[:, None]
        merged[name] = np.where(mask, finals[name], infos[name])
    return merged


class MeasurementProbe:
    """Reads the measurements by flying the same episodes with a filter that trusts only them.

    Attributes:
        seen: the last measured positions (policies, few, 3), m; NaN where none arrived.
    """

    def __init__(
        self, scenario: Scenario, policies: int, seeds: Sequence[int], options: dict[str, Array] | None
    ) -> None:
        self._shape = (policies, len(seeds))
        self._env = FormationVectorEnv(
            policies * len(seeds), replace(scenario, filter=replace(scenario.filter, **_POSITION_ONLY_TRUST))
        )
        self._read(self._env.reset(seed=[*seeds] * policies, options=options)[1])

    def step(self, actions: Floats) -> None:
        """Take the same step, given the actions of all rows (rows, 3)."""
        policies, few = self._shape
        chosen = actions.reshape(policies, -1, 3)[:, :few].reshape(-1, 3)
        *_, terminations, truncations, infos = self._env.step(chosen)
        self._read(with_final_infos(infos) if (terminations | truncations).any() else infos)

    def _read(self, infos: dict[str, Any]) -> None:
        seen = np.where(infos["measured"][:, None], infos["estimate"][:, :3], np.nan)
        self.seen = seen.reshape(*self._shape, 3)
