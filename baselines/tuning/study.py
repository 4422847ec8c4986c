"""How it is searched: Optuna's TPE in batches, kept in a journal that an interrupted search goes on from.

A batch of candidates depends on the trials of the batches before it alone, and its random numbers on its place. So a
search in several goes finds what one go would have found, trial by trial, even if it was stopped within a batch.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from baselines.controllers.registry import make_policy
from baselines.experiments.policy_batch import SideBySide
from baselines.tuning.knobs import Knob, read, turn
from formation_env.evaluation.rollout import MAX_ROWS, Policy, evaluate
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.scenario import Scenario

if TYPE_CHECKING:
    from optuna import Study
    from optuna.trial import FrozenTrial

BATCH: Final = 8
"""Candidates that fly side by side."""

FIRST_KEY: Final = b'{"op_code":'
"""What a journal of Optuna begins with."""


@dataclass(frozen=True)
class Task:
    """What to search for.

    Attributes:
        policy: its name.
        scenario: what it flies.
        episode_seeds: one per episode, the same for all candidates.
        gains: what to begin with; gains without a knob stay.
        knobs: what to turn.
    """

    policy: str
    scenario: Scenario
    episode_seeds: range
    gains: dict[str, Any]
    knobs: tuple[Knob, ...]

    @property
    def name(self) -> str:
        """Of its study: a hash of all that a trial's cost depends on, so that no study goes on with another task."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:16]

    def costs(self, candidates: Sequence[dict[str, float]]) -> Array:
        """Mean costs (candidates,), m/s, with the knobs at the candidates' values."""
        gains = [turn(self.gains, self.knobs, candidate) for candidate in candidates]
        return costs(
            [make_policy(self.policy, self.scenario, each) for each in gains], self.scenario, self.episode_seeds
        )


@dataclass(frozen=True)
class Found:
    """The end of a search.

    Attributes:
        gains: the best.
        cost: their mean cost, m/s.
        first_cost: that of the gains that the search began with, m/s.
        trial: which trial it was; 0 is the first.
    """

    gains: dict[str, Any]
    cost: float
    first_cost: float
    trial: int


def costs(policies: Sequence[Policy], scenario: Scenario, episode_seeds: Sequence[int]) -> Array:
    """Mean cost (policies,) over the same episodes, minus the mean return, m/s."""
    # evaluate cuts what has more rows into parts, in which the policies' shares would not be equal
    at_once = max(1, MAX_ROWS // len(episode_seeds))
    groups = [policies[i : i + at_once] for i in range(0, len(policies), at_once)]
    flown = [evaluate(SideBySide(group), scenario, [*episode_seeds] * len(group))["return"] for group in groups]
    per_policy: Array = -np.concatenate(flown).reshape(len(policies), -1).mean(axis=1)
    return per_policy


def search(
    task: Task,
    trials: int,
    journal: Path,
    progress: Callable[[int], Any] = lambda count: None,
    present: dict[str, float] | None = None,
) -> Found:
    """The best of a number of trials; those that the journal has are not flown again.

    Args:
        task: what to search for.
        trials: how many, with the first gains as trial 0.
        journal: file of the study; made if it does not exist, and added to after each batch.
        progress: called with the number of trials that have just become known.
        present: where the knobs stand in the gains used up to now; a new study has them as trial 1.

    Raises:
        ConfigError: the file is no journal.
        OSError: it cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    study = open_study(task.name, journal)
    known = study.get_trials(deepcopy=False)[:trials]
    progress(len(known))
    while len(known) < trials:
        first = len(known) // BATCH * BATCH
        batch = candidates(task, known[:first], present)[len(known) - first : trials - first]
        add(study, task.knobs, batch, task.costs(batch))
        known = study.get_trials(deepcopy=False)[:trials]
        progress(len(batch))
    values = [float(trial.values[0]) for trial in known]
    best = known[int(np.argmin(values))]
    return Found(turn(task.gains, task.knobs, best.params), min(values), values[0], best.number)


def candidates(
    task: Task, before: Sequence["FrozenTrial"], present: dict[str, float] | None = None
) -> list[dict[str, float]]:
    """The batch of candidates that follows the trials of the batches before; the first has what is known already."""
    from optuna import create_study
    from optuna.samplers import TPESampler

    # asked in memory, so that a journal has no trial without its cost
    study = create_study(sampler=TPESampler(seed=len(before), multivariate=True, constant_liar=True))
    study.add_trials(before)
    if not before:
        for known in filter(None, (read(task.gains, task.knobs), present)):
            study.enqueue_trial(known, skip_if_exists=True)
    return [study.ask(distributions(task.knobs)).params for _ in range(BATCH)]


def add(study: "Study", knobs: Sequence[Knob], batch: Sequence[dict[str, float]], values: Array) -> None:
    """Keep a batch's candidates with their costs."""
    from optuna.trial import create_trial

    for params, value in zip(batch, values, strict=True):
        study.add_trial(create_trial(params=params, distributions=distributions(knobs), value=float(value)))


def open_study(name: str, journal: Path) -> "Study":
    """The study of that name in a journal; a new one if there is none.

    Raises:
        ConfigError: the file is no journal.
        OSError: it cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    journal.parent.mkdir(parents=True, exist_ok=True)
    try:
        _cut_torn_line(journal)
        return optuna.create_study(
            storage=JournalStorage(JournalFileBackend(str(journal))), study_name=name, load_if_exists=True
        )
    except (ValueError, LookupError, TypeError, AttributeError):
        raise ConfigError(f"{journal}: is no journal of Optuna; remove it, or give another folder") from None


def _cut_torn_line(journal: Path) -> None:
    """Remove the part of a line that a kill or a full disk left at a journal's end.

    Raises:
        ValueError: the file does not begin as a journal does.
    """
    with journal.open("ab+") as file:
        file.seek(0)
        text = file.read()
        if not text.startswith(FIRST_KEY[: len(text)]):
            raise ValueError("no journal")
        file.truncate(text.rfind(b"\n") + 1)


def distributions(knobs: Sequence[Knob]) -> dict[str, Any]:
    """The knobs' limits, as Optuna wants them."""
    from optuna.distributions import FloatDistribution

    return {knob.name: FloatDistribution(knob.low, knob.high, log=knob.log) for knob in knobs}
