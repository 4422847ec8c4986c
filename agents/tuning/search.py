"""Search trial by trial with Optuna's TPE and early stopping, in a journal from which it continues.

A candidate depends only on the finished trials before it, its random numbers on its index, and a training is
reproducible. So an interrupted and continued search gives the same result as an uninterrupted one.
"""

import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from agents.algorithms.registry import ALGORITHMS
from agents.hyperparameters import CommonSettings
from agents.training.run_folder import Run, read_curve, start_file
from agents.training.train import check_run, pretrained, train
from agents.tuning.search_space import apply, current_values, search_space
from baselines.tuning.journal import add_trial, open_study, trials_of
from baselines.tuning.settings_file import commented
from baselines.tuning.study import distributions
from formation_env.files import write_texts
from formation_env.settings import ConfigError

if TYPE_CHECKING:
    from optuna.trial import FrozenTrial

JOURNAL: Final = "trials.journal"
BEST: Final = "best.yaml"
"""Best hyperparameters so far, in the form that `--config` of a training takes."""
MIN_TRIALS_BEFORE_PRUNING: Final = 4
"""Trials that are trained to the end before any is stopped early: a median of fewer says little."""


@dataclass(frozen=True)
class SearchResult:
    """State of a search.

    Attributes:
        agent: best hyperparameters.
        cost: validation cost at the end of their training, m/s.
        trial: index of that trial; trial 0 has the initial hyperparameters.
        first_cost: cost of trial 0, m/s.
        trials: number of trials that are finished or were stopped early.
    """

    agent: CommonSettings
    cost: float
    trial: int
    first_cost: float
    trials: int

    def in_words(self) -> str:
        """One-line summary for the user."""
        return (
            f"best of {self.trials} trials: {self.cost:.5g} m/s on the validation seeds (trial {self.trial}; "
            f"trial 0: {self.first_cost:.5g} m/s)"
        )


def search(
    run: Run, trials: int, folder: Path, progress: Callable[[SearchResult], Any] = lambda result: None
) -> SearchResult:
    """Run trials until there are as many as asked for; those in the journal are not repeated.

    The cost of a trial is that on the validation seeds at the end of its training and not the best one on the way: the
    common starting point may be better than the end of most trainings.

    Args:
        run: settings of each training, except for the hyperparameters that are searched.
        trials: number of trials, with the run's own hyperparameters as trial 0.
        folder: of the journal, of the actor that all trials start from, and of the best hyperparameters.
        progress: called after each trial.

    Raises:
        ConfigError: the run fails `check_run`, a file in the folder is damaged, or the actor does not fit.
        KeyboardInterrupt: a training was interrupted; the trials before it are kept.
        OSError: the folder cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    check_run(run)
    name, journal = task_name(run), folder / JOURNAL
    study = open_study(identity(run), journal)
    run = _with_shared_start(run, folder / name)
    while len(known := trials_of(study)) < trials:
        add_trial(study, _run_trial(run, known))
        result = best_of(run, trials_of(study))
        write_texts(folder, {BEST: _to_yaml(run, result)})
        progress(result)
    return best_of(run, known[:trials])


def identity(run: Run) -> dict[str, str | int]:
    """Identity of a study, stored in its journal."""
    return {"algorithm": run.algorithm, "task": task_name(run)}


def task_name(run: Run) -> str:
    """Name of a study: a hash of everything that a trial's cost depends on, so that tasks are never mixed."""
    given = start_file(run)
    start = hashlib.sha256(given.read_bytes()).hexdigest() if given else ""
    task = replace(run, env="-", start="", command="", versions={})
    space = search_space(ALGORITHMS[run.algorithm])
    return hashlib.sha256(repr((task, start, space)).encode()).hexdigest()[:16]


def _with_shared_start(run: Run, folder: Path) -> Run:
    """Replace the run's pretraining by an actor that is pretrained once for all trials."""
    if run.start or run.agent.pretraining is None:
        return run
    return replace(run, start=str(pretrained(run, folder)))


def best_of(run: Run, known: Sequence["FrozenTrial"]) -> SearchResult:
    """Best trial among those that were trained to the end."""
    costs = [np.inf if trial.values is None else float(trial.values[0]) for trial in known]
    best = int(np.argmin(costs))
    return SearchResult(apply(run.agent, known[best].params), costs[best], best, costs[0], len(known))


def _run_trial(run: Run, known: Sequence["FrozenTrial"]) -> "FrozenTrial":
    """Choose and train the candidate that follows the known trials."""
    from optuna import create_study
    from optuna.samplers import TPESampler
    from optuna.trial import TrialState, create_trial

    limits = distributions(search_space(type(run.agent)))
    # The sampler works on a copy in memory: a journal holds no trial without its result.
    study = create_study(sampler=TPESampler(seed=len(known), multivariate=True))
    study.add_trials(known)
    if not known:
        study.enqueue_trial(current_values(run.agent))
    params = study.ask(limits).params
    candidate = replace(run, agent=apply(run.agent, params))
    costs, finished = _train(candidate, [trial.intermediate_values for trial in known])
    return create_trial(
        params=params,
        distributions=limits,
        intermediate_values=costs,
        value=costs[max(costs)] if finished else None,
        state=TrialState.COMPLETE if finished else TrialState.PRUNED,
    )


def _train(run: Run, others: Sequence[Mapping[int, float]]) -> tuple[dict[int, float], bool]:
    """Validation costs by step, m/s, and whether the training reached its end."""

    def above_median(curve: Sequence[Mapping[str, float]]) -> bool:
        # Optuna's own pruner compares the best cost so far, which is that of the common start.
        step, cost = int(curve[-1]["steps"]), -curve[-1]["return"]
        earlier = [costs[step] for costs in others if step in costs]
        return len(earlier) >= MIN_TRIALS_BEFORE_PRUNING and cost > float(np.median(earlier))

    with tempfile.TemporaryDirectory() as scratch:
        try:
            outcome = train(run, Path(scratch) / "run", give_up=above_median)
        except ConfigError:
            raise
        except ValueError:  # torch's error for a diverged network, whose outputs are NaN
            if not others:
                raise
            outcome = "given up"
        curve = read_curve(Path(scratch) / "run")
    if outcome == "interrupted":
        raise KeyboardInterrupt
    costs = dict(zip(curve["steps"].astype(int).tolist(), (-curve["return"]).tolist(), strict=True))
    return costs, outcome == "finished"


def _to_yaml(run: Run, result: SearchResult) -> str:
    """File of hyperparameters, with a comment on the search that gave them."""
    return commented(
        asdict(result.agent),
        f"{run.command or 'formation-env agents tune'}\n{run.env}, {run.steps} steps; {result.in_words()}",
    )
