"""Several policies in one batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Actions, Observations


class SideBySide:
    """Policies that fly equal shares of a batch's rows, in order."""

    def __init__(self, policies: Sequence[Policy]) -> None:
        self.policies = policies

    def predict(
        self, observation: Observations, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """Actions (rows, 3) for observations (rows, SIZE)."""
        shares = np.split(observation, len(self.policies))
        actions = [policy.predict(share)[0] for policy, share in zip(self.policies, shares, strict=True)]
        return np.concatenate(actions), state
