"""Jobs of a report for `experiments.parallel`: metrics of many episodes, and one episode instant by instant."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import pandas as pd

from baselines.experiments.parallel import Progress, ProgressShare
from baselines.experiments.policy_factories import PolicyFactory, cache_key
from formation_env.evaluation.rollout import Policy, evaluate, record
from formation_env.task.scenario import Scenario

CHUNK: Final = 5
"""Episodes of a slow policy in one job; a fast policy flies all of its episodes in one batch."""
SLOW_COST: Final = 40
"""Time per action of a slow policy, in steps of a batch."""
ACTION_TIME: Final = "action_time_us"
"""Column of a flight: time of `predict` for the single observation before, microseconds."""


@dataclass(frozen=True)
class Episodes:
    """Episodes of a policy, with their metrics.

    Attributes:
        scenario: the environment.
        policy: label.
        factory: makes the policy.
        seeds: one per episode.
        slow: whether the policy is slow.
    """

    scenario: Scenario
    policy: str
    factory: PolicyFactory
    seeds: tuple[int, ...]
    slow: bool

    @property
    def cost(self) -> int:
        """Estimated duration, in steps of a batch."""
        return self.scenario.num_steps * (SLOW_COST * len(self.seeds) if self.slow else 1)

    @property
    def key(self) -> Any:
        """Cache key (compared by repr); None, where the policy does not give its settings, disables caching."""
        settings = cache_key(self.factory, self.scenario)
        return None if settings is None else (self.scenario, self.policy, settings, self.seeds)

    def run(self, progress: Progress) -> pd.DataFrame | None:
        """The table of `formation_env.evaluation.evaluate`; None if there is no policy for the scenario."""
        policy = self.factory(self.scenario, self.scenario)
        share = ProgressShare(progress, self.cost, self.scenario.num_steps * len(self.seeds))
        table = None if policy is None else evaluate(policy, self.scenario, self.seeds, share.advance)
        share.finish()
        return table


@dataclass(frozen=True)
class Flight:
    """One episode of a policy, instant by instant.

    Attributes:
        scenario: the environment.
        policy: label.
        factory: makes the policy.
        seed: of the episode.
        slow: whether the policy is slow.
    """

    scenario: Scenario
    policy: str
    factory: PolicyFactory
    seed: int
    slow: bool

    @property
    def cost(self) -> int:
        """Estimated duration, in steps of a batch."""
        return self.scenario.num_steps * (SLOW_COST if self.slow else 1)

    @property
    def key(self) -> Any:
        """Cache key (compared by repr); None, where the policy does not give its settings, disables caching."""
        settings = cache_key(self.factory, self.scenario)
        return None if settings is None else (self.scenario, self.policy, settings, self.seed)

    def run(self, progress: Progress) -> pd.DataFrame:
        """The table of `formation_env.evaluation.record`, with the time of each action, `ACTION_TIME`."""
        policy = self.factory(self.scenario, self.scenario)
        assert policy is not None, "it has flown its episodes"
        timed = Stopwatch(policy)
        table = record(timed, self.scenario, self.seed)
        table[ACTION_TIME] = [np.nan, *timed.times_us]
        progress(self.cost)
        return table


@dataclass(frozen=True)
class Stopwatch:
    """A policy that receives one observation at a time, and the time per action.

    Attributes:
        policy: the policy.
        times_us: of the actions so far, microseconds.
    """

    policy: Policy
    times_us: list[float] = field(default_factory=list)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """The action (1, 3) for a batch of one observation (1, SIZE), and the policy's state."""
        start = time.perf_counter_ns()
        action, state = self.policy.predict(observation[0], state, episode_start, deterministic)
        self.times_us.append(1e-3 * (time.perf_counter_ns() - start))
        return action[None], state


def episode_jobs(
    policies: Mapping[str, PolicyFactory], env: str, scenario: Scenario, seeds: Sequence[int], slow: Mapping[str, int]
) -> dict[tuple[str, str, int], Episodes]:
    """Jobs of an environment, by environment, policy and first seed.

    Args:
        policies: label -> factory.
        env: name of the environment.
        scenario: its settings.
        seeds: one episode each.
        slow: label of each slow policy -> number of seeds it flies.
    """
    jobs = {}
    for name, factory in policies.items():
        own = tuple(seeds)[: slow.get(name)]
        length = CHUNK if name in slow else len(own)
        for start in range(0, len(own), length):
            chunk = own[start : start + length]
            jobs[env, name, chunk[0]] = Episodes(scenario, name, factory, chunk, name in slow)
    return jobs
