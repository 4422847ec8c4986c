"""Optuna's TPE in batches, with a journal from which an interrupted search continues.

A batch of candidates depends only on the trials of the batches before it, and its random numbers on its position. So an
interrupted search finds what an uninterrupted one finds, trial by trial, even if it stopped within a batch.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from baselines.controllers.registry import make_policy
from baselines.controllers.search_space import Parameter
from baselines.experiments.policy_batch import PolicyBatch
from baselines.tuning.journal import add_trial, digest, open_study, trials_of
from baselines.tuning.search_space import apply, current_values
from formation_env.evaluation.rollout import MAX_ROWS, Policy, evaluate
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

if TYPE_CHECKING:
    from optuna import Study
    from optuna.trial import FrozenTrial

BATCH: Final = 8
"""Candidates flown in one batched environment."""


@dataclass(frozen=True, kw_only=True)
class TuningTask:
    """Task of a search.

    Attributes:
        policy: name of the policy.
        scenario: the scenario that it flies.
        episode_seeds: one seed per episode, the same for all candidates.
        settings: where the search starts; settings outside the search space stay.
        parameters: the search space.
    """

    policy: str
    scenario: Scenario
    episode_seeds: range
    settings: dict[str, Any]
    parameters: tuple[Parameter, ...]

    @property
    def identity(self) -> dict[str, str | int]:
        """All that a trial's cost depends on; a study continues for the same identity only."""
        return {
            "policy": self.policy,
            "scenario_sha256": digest(repr(self.scenario)),
            "first_seed": self.episode_seeds[0],
            "episodes": len(self.episode_seeds),
            "settings_sha256": digest(self.settings),
            "search_space_sha256": digest(repr(self.parameters)),
        }

    def costs(self, candidates: Sequence[Mapping[str, float]]) -> Array:
        """Mean costs (candidates,), m/s, with the parameters at the candidates' values."""
        settings = [apply(self.settings, self.parameters, candidate) for candidate in candidates]
        policies = [make_policy(self.policy, self.scenario, each) for each in settings]
        return costs(policies, self.scenario, self.episode_seeds)


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """The result of a search.

    Attributes:
        settings: the best settings.
        cost: their mean cost, m/s.
        first_cost: mean cost of the settings that the search started with, m/s.
        trial: number of the best trial; 0 is the first.
    """

    settings: dict[str, Any]
    cost: float
    first_cost: float
    trial: int


def costs(policies: Sequence[Policy], scenario: Scenario, episode_seeds: Sequence[int]) -> Array:
    """Mean cost (policies,) over the same episodes, minus the mean return, m/s."""
    # evaluate splits larger batches, and the policies would not get equal shares of the parts
    at_once = max(1, MAX_ROWS // len(episode_seeds))
    groups = [policies[i : i + at_once] for i in range(0, len(policies), at_once)]
    returns = [evaluate(PolicyBatch(group), scenario, [*episode_seeds] * len(group))["return"] for group in groups]
    per_policy: Array = -np.concatenate(returns).reshape(len(policies), -1).mean(axis=1)
    return per_policy


def search(
    task: TuningTask,
    trials: int,
    journal: Path,
    progress: Callable[[int], Any] = lambda count: None,
    in_use: dict[str, float] | None = None,
) -> SearchResult:
    """Find the best of a number of trials; those in the journal are not flown again.

    Args:
        task: what to optimise.
        trials: number of trials; trial 0 has the task's own settings.
        journal: file of the study; made if it does not exist, and extended after each batch.
        progress: called with the number of newly known trials.
        in_use: values of the parameters in the settings used so far; a new study has them as trial 1.

    Raises:
        ConfigError: the file is no journal, or damaged.
        OSError: it cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    study = open_study(task.identity, journal)
    known = trials_of(study)[:trials]
    progress(len(known))
    while len(known) < trials:
        first = len(known) // BATCH * BATCH
        batch = candidates(task, known[:first], in_use)[len(known) - first : trials - first]
        add(study, task.parameters, batch, task.costs(batch))
        known = trials_of(study)[:trials]
        progress(len(batch))
    values = [float(trial.values[0]) for trial in known]
    best = known[int(np.argmin(values))]
    settings = apply(task.settings, task.parameters, best.params)
    return SearchResult(settings=settings, cost=min(values), first_cost=values[0], trial=best.number)


def candidates(
    task: TuningTask, before: Sequence["FrozenTrial"], in_use: dict[str, float] | None = None
) -> list[dict[str, float]]:
    """The batch of candidates after the trials of earlier batches; the first batch starts with known settings."""
    from optuna import create_study
    from optuna.samplers import TPESampler

    # sampled in memory, so that the journal never holds a trial without its cost
    study = create_study(sampler=TPESampler(seed=len(before), multivariate=True, constant_liar=True))
    study.add_trials(before)
    if not before:
        for known in filter(None, (current_values(task.settings, task.parameters), in_use)):
            study.enqueue_trial(known, skip_if_exists=True)
    return [study.ask(distributions(task.parameters)).params for _ in range(BATCH)]


def add(study: "Study", parameters: Sequence[Parameter], batch: Sequence[dict[str, float]], values: Array) -> None:
    """Append a batch's candidates with their costs to the journal."""
    from optuna.trial import create_trial

    limits = distributions(parameters)
    for params, value in zip(batch, values, strict=True):
        add_trial(study, create_trial(params=params, distributions=limits, value=float(value)))


def distributions(parameters: Sequence[Parameter]) -> dict[str, Any]:
    """The search space as Optuna's distributions."""
    from optuna.distributions import FloatDistribution

    return {each.name: FloatDistribution(each.low, each.high, log=each.log) for each in parameters}
