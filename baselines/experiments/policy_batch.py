"""Several policies in one batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Actions, Observations


class SideBySide:
    """Policies that fly equal shares of a batch's rows, in order; each keeps its own state."""

    def __init__(self, policies: Sequence[Policy]) -> None:
        self.policies = policies

    def predict(
        self, observation: Observations, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """Actions (rows, 3) for observations (rows, SIZE), and the policies' states, one each."""
        count = len(self.policies)
        observations = np.split(observation, count)
        starts = [None] * count if episode_start is None else np.split(np.asarray(episode_start), count)
        states = [None] * count if state is None else state
        found = [
            policy.predict(own, before, start, deterministic)
            for policy, own, before, start in zip(self.policies, observations, states, starts, strict=True)
        ]
        actions = np.concatenate([action for action, _ in found])
        after = [own for _, own in found]
        return actions, None if all(own is None for own in after) else after
