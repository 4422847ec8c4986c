"""Several policies in one batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Actions, Observations


class PolicyBatch:
    """Policies that fly equal shares of a batch's rows, in order; each keeps a state of its own."""

    def __init__(self, policies: Sequence[Policy]) -> None:
        self.policies = policies

    def predict(
        self,
        observation: Observations,
        state: Sequence[Any] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, list[Any]]:
        """Actions (rows, 3) for observations (rows, SIZE).

        Args:
            observation: (rows, SIZE).
            state: of each policy, as the last call returned it; None before the first.
            episode_start: whether a row's episode begins (rows,); each policy gets its share.
            deterministic: handed to each policy.

        Returns:
            Actions (rows, 3), and the policies' new states.
        """
        count = len(self.policies)
        shares = np.split(observation, count)
        states = [None] * count if state is None else state
        starts = [None] * count if episode_start is None else np.split(np.asarray(episode_start), count)
        results = [
            policy.predict(share, state=own, episode_start=start, deterministic=deterministic)
            for policy, share, own, start in zip(self.policies, shares, states, starts, strict=True)
        ]
        return np.concatenate([actions for actions, _ in results]), [own for _, own in results]
