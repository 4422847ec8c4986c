"""How it is searched: trial by trial by Optuna's TPE, hopeless ones given up, kept in a journal to go on from.

A candidate depends on the finished trials before it alone, and its random numbers on its place; a training repeats
itself. So a search in several goes finds what one go would have found.
"""

import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from agents.hyperparameters import AgentSettings
from agents.training.run_folder import Run, read_curve, start_file
from agents.training.train import pretrained, train
from agents.tuning.knobs import KNOBS, present, turned
from baselines.tuning.journal import add_trial, open_study, trials_of
from baselines.tuning.settings_file import commented
from baselines.tuning.study import distributions
from formation_env.files import write_texts

if TYPE_CHECKING:
    from optuna.trial import FrozenTrial

JOURNAL: Final = "trials.journal"
BEST: Final = "best.yaml"
"""The best hyperparameters up to now, as `--config` of a training takes them."""
FEW: Final = 4
"""Trials that go to their end before any is given up."""


@dataclass(frozen=True)
class Found:
    """Where a search stands.

    Attributes:
        agent: the best hyperparameters.
        cost: validation cost at their training's end, m/s.
        trial: which trial it was; 0 has the hyperparameters that the search began with.
        first_cost: of trial 0, m/s.
        trials: how many have been finished or given up.
    """

    agent: AgentSettings
    cost: float
    trial: int
    first_cost: float
    trials: int

    def in_words(self) -> str:
        """For people."""
        return (
            f"best of {self.trials} trials: {self.cost:.5g} m/s on the validation seeds (trial {self.trial}; "
            f"trial 0: {self.first_cost:.5g} m/s)"
        )


def search(run: Run, trials: int, folder: Path, tell: Callable[[Found], Any] = lambda found: None) -> Found:
    """The best of a number of trials; those that the journal has are not trained again.

    A trial costs what its policy costs on the validation seeds at the training's end, and not at its best: what all
    begin with may be better than what most come to.

    Args:
        run: the training; `steps` and all else count for each trial, but for the hyperparameters that are searched.
        trials: how many, with the run's own hyperparameters as trial 0.
        folder: of the journal, of the actor that all trials start from, and of the best hyperparameters.
        tell: called after each trial.

    Raises:
        ConfigError: a file in the folder is no journal, or the run's actor to start from does not fit.
        KeyboardInterrupt: a training was interrupted; the trials before it are kept.
        OSError: the folder cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    name = task_name(run)
    study = open_study({"algorithm": run.algorithm, "task": name}, folder / JOURNAL)
    run = _started(run, folder / name)
    while len(known := trials_of(study)) < trials:
        add_trial(study, _try(run, known))
        found = best_of(run, trials_of(study))
        write_texts(folder, {BEST: _to_yaml(run, found)})
        tell(found)
    return best_of(run, known[:trials])


def task_name(run: Run) -> str:
    """Of a study: a hash of all that a trial's cost depends on, so that no study goes on with another task."""
    given = start_file(run)
    start = hashlib.sha256(given.read_bytes()).hexdigest() if given else ""
    task = replace(run, env="-", start="", command="", versions={})
    return hashlib.sha256(repr((task, start, KNOBS[run.algorithm])).encode()).hexdigest()[:16]


def _started(run: Run, folder: Path) -> Run:
    """The run, beginning with an actor that was pretrained once for all trials, if it is to be pretrained."""
    if run.start or run.agent.pretraining is None:
        return run
    return replace(run, start=str(pretrained(run, folder)))


def best_of(run: Run, known: Sequence["FrozenTrial"]) -> Found:
    """The best of the trials that were not given up."""
    costs = [np.inf if trial.values is None else float(trial.values[0]) for trial in known]
    best = int(np.argmin(costs))
    return Found(turned(run.algorithm, run.agent, known[best].params), costs[best], best, costs[0], len(known))


def _try(run: Run, known: Sequence["FrozenTrial"]) -> "FrozenTrial":
    """The trial that follows the known ones, trained."""
    from optuna import create_study
    from optuna.samplers import TPESampler
    from optuna.trial import TrialState, create_trial

    knobs = KNOBS[run.algorithm]
    # asked in memory, so that a journal has no trial without its end
    study = create_study(sampler=TPESampler(seed=len(known), multivariate=True))
    study.add_trials(known)
    if not known:
        study.enqueue_trial(present(run.algorithm, run.agent))
    params = study.ask(distributions(knobs)).params
    candidate = replace(run, agent=turned(run.algorithm, run.agent, params))
    costs, ended = _train(candidate, [trial.intermediate_values for trial in known])
    return create_trial(
        params=params,
        distributions=distributions(knobs),
        intermediate_values=costs,
        value=costs[max(costs)] if ended else None,
        state=TrialState.COMPLETE if ended else TrialState.PRUNED,
    )


def _train(run: Run, others: Sequence[Mapping[int, float]]) -> tuple[dict[int, float], bool]:
    """Validation costs by step, m/s, and whether the training came to its end."""

    def hopeless(lines: Sequence[Mapping[str, float]]) -> bool:
        # Optuna's pruner compares the best so far, which is what all begin with
        step, cost = int(lines[-1]["steps"]), -lines[-1]["return"]
        theirs = [costs[step] for costs in others if step in costs]
        return len(theirs) >= FEW and cost > float(np.median(theirs))

    with tempfile.TemporaryDirectory() as scratch:
        try:
            outcome = train(run, Path(scratch) / "run", give_up=hopeless)
        except ValueError:  # no more numbers in the network
            if not others:
                raise
            outcome = "given up"
        curve = read_curve(Path(scratch) / "run")
    if outcome == "interrupted":
        raise KeyboardInterrupt
    costs = dict(zip(curve["steps"].astype(int).tolist(), (-curve["return"]).tolist(), strict=True))
    return costs, outcome == "finished"


def _to_yaml(run: Run, found: Found) -> str:
    """A file of hyperparameters, with a comment that says how they were found."""
    return commented(
        asdict(found.agent),
        f"{run.command or 'formation-env agents tune'}\n{run.env}, {run.steps} steps; {found.in_words()}",
    )
