"""Policies side by side: each sees its own rows, its own memory and its own episodes' starts."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.experiments.policy_batch import PolicyBatch
from formation_env import load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.numerics.arrays import Actions, Observations


@dataclasses.dataclass
class Alternating:
    """A policy with memory: it counts the steps of each row's episode, and thrusts one way, then the other."""

    thrust: float

    def predict(
        self,
        observation: Observations,
        state: NDArray[np.intp] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        assert deterministic
        assert episode_start is not None
        assert episode_start.shape == observation.shape[:1]
        count = np.zeros(len(observation), np.intp) if state is None else state
        count = np.where(episode_start, 0, count + 1)
        sign = np.where(count % 6 < 3, 1.0, -1.0)
        return np.repeat((self.thrust * sign)[:, None], 3, axis=1).astype(np.float32), count


def test_policies_with_memory_fly_as_they_do_alone() -> None:
    """Equal bits, episode by episode."""
    scenario, seeds = dataclasses.replace(load_scenario("keeping"), dt_s=240.0), [1, 2, 3]
    policies = [Alternating(0.02), Alternating(0.3)]
    together = evaluate(PolicyBatch(policies), scenario, [*seeds, *seeds])["return"].to_numpy().reshape(2, 3)
    alone = [evaluate(policy, scenario, seeds)["return"].to_numpy() for policy in policies]
    np.testing.assert_array_equal(together, alone)
