"""Hyperparameter search: validation costs, continuation to the same result, early stopping."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from agents_helpers import PRETRAINED, SMALL, assert_refused, small_run
from damage_helpers import refusals
from optuna.trial import FrozenTrial, TrialState
from typer.testing import CliRunner

from agents.algorithms.registry import ALGORITHMS, load_settings
from agents.cli import app
from agents.training.run_folder import CURVE, START, Run, read_curve
from agents.training.train import train
from agents.tuning import search as searching
from agents.tuning.search import BEST, JOURNAL, MIN_TRIALS_BEFORE_PRUNING, identity, search, task_name
from agents.tuning.search_space import apply, current_values, search_space
from baselines.tuning.journal import open_study
from formation_env import ENV_IDS
from formation_env.cli_errors import INTERRUPTED

STEPS = (0, 100, 200)
BOTTOM = 1e-4
"""The learning rate at which the bowl has its least value."""


def trials_in(run: Run, folder: Path) -> list[FrozenTrial]:
    """The trials in a study's journal."""
    return open_study(identity(run), folder / JOURNAL).get_trials()


def numbers(trials: Sequence[FrozenTrial]) -> list[list[Any]]:
    """What must be the same in two studies."""
    return [[trial.number, trial.values, trial.params, trial.intermediate_values] for trial in trials]


def bowl(run: Run, folder: Path, give_up: Callable[[Any], bool]) -> str:
    """In place of a training: all begin at 1, and come to the squared decades from the bottom."""
    end, lines = np.log10(run.agent.learning_rate / BOTTOM) ** 2, []
    for step in STEPS:
        lines.append({"steps": step, "seconds": 0.0, "return": -(1 + (end - 1) * step / STEPS[-1])})
        folder.mkdir(exist_ok=True)
        pd.DataFrame(lines).to_csv(folder / CURVE, index=False)
        if give_up(lines):
            return "given up"
    return "finished"


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_search_space_names_hyperparameters(algorithm: str) -> None:
    """Limits are accepted, the shipped files lie within them, and applying the current values changes nothing."""
    for env in ENV_IDS:
        agent = load_settings(algorithm, env)
        assert apply(agent, current_values(agent)) == agent
        space = search_space(ALGORITHMS[algorithm])
        for values in ({each.name: each.low for each in space}, {each.name: each.high for each in space}):
            assert current_values(apply(agent, values)) == values


def test_the_cost_is_that_of_the_training(tmp_path: Path) -> None:
    """Trained again with the file that was written, the last validation is the cost of the search, to its six digits.

    Trial 0 has the run's own hyperparameters, and nothing that was found is worse.
    """
    run = small_run(tmp_path, "ppo", steps=256)
    found = search(run, 3, tmp_path / "study")
    own, best = tmp_path / "own", tmp_path / "best"
    train(run, own)
    train(small_run(tmp_path, "ppo", steps=256, config=tmp_path / "study" / BEST), best)
    for folder, cost in ((own, found.first_cost), (best, found.cost)):
        assert read_curve(folder)["return"].iloc[-1] == pytest.approx(-cost, rel=1e-12)
    assert load_settings("ppo", run.env, tmp_path / "study" / BEST) == found.agent
    assert found.cost <= found.first_cost
    assert (tmp_path / "study" / BEST).read_text().count(f"{found.cost:.5g} m/s") >= 1


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_stopped_search_goes_on_as_if_it_had_not_been(algorithm: str, tmp_path: Path) -> None:
    """Number by number what one go finds; a finished study trains nothing."""
    run = small_run(tmp_path, algorithm, steps=128, validations=1)
    found = search(run, 3, tmp_path / "one")
    search(run, 1, tmp_path / "two")
    assert len(trials_in(run, tmp_path / "two")) == 1
    progress: list[int] = []
    assert search(run, 3, tmp_path / "two", lambda now: progress.append(now.trials)) == found
    assert progress == [2, 3]
    assert numbers(trials_in(run, tmp_path / "one")) == numbers(trials_in(run, tmp_path / "two"))
    assert search(run, 3, tmp_path / "two", lambda now: progress.append(now.trials)) == found
    assert progress == [2, 3]


def test_hopeless_trials_are_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand: above the median of the earlier trials at the same step, once there are enough; and a bottom is found.

    All begin alike, so a start better than most ends must not save a trial. Of 30 random learning rates over 2.5
    decades the nearest is within 0.05 decades with a probability of 70 %.
    """
    monkeypatch.setattr(searching, "train", bowl)
    run = small_run(tmp_path, "ppo")
    found = search(run, 30, tmp_path / "study")
    trials, given_up = trials_in(run, tmp_path / "study"), 0
    for trial in trials:
        last = max(trial.intermediate_values)
        earlier = [
            other.intermediate_values[last] for other in trials[: trial.number] if last in other.intermediate_values
        ]
        above = len(earlier) >= MIN_TRIALS_BEFORE_PRUNING and trial.intermediate_values[last] > np.median(earlier)
        assert (trial.state == TrialState.PRUNED) == above
        given_up += above
    assert 5 < given_up < 30
    assert all(trial.state == TrialState.COMPLETE for trial in trials[:MIN_TRIALS_BEFORE_PRUNING])
    assert found.cost == min(trial.values[0] for trial in trials if trial.values)
    assert found.cost < 0.05**2
    assert found.first_cost == pytest.approx(np.log10(run.agent.learning_rate / BOTTOM) ** 2, rel=1e-5)


def test_a_diverging_trial_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A network without numbers ends its trial and not the search; the first one's fault is the user's."""

    def breaks(run: Run, folder: Path, give_up: Callable[[Any], bool]) -> str:
        if run.agent.learning_rate != first:
            bowl(run, folder, lambda lines: len(lines) == 2)
            raise ValueError("nan")
        return bowl(run, folder, give_up)

    run = small_run(tmp_path, "ppo")
    monkeypatch.setattr(searching, "train", breaks)
    first = run.agent.learning_rate
    search(run, 3, tmp_path / "study")
    states = [trial.state for trial in trials_in(run, tmp_path / "study")]
    assert states == [TrialState.COMPLETE, TrialState.PRUNED, TrialState.PRUNED]
    first = 0.0
    with pytest.raises(ValueError, match="nan"):
        search(run, 3, tmp_path / "other")


def test_all_trials_start_from_one_actor(tmp_path: Path) -> None:
    """It is pretrained once, also for a search that goes on; a study of another task has its own."""
    run = small_run(tmp_path, "ppo", PRETRAINED, steps=128, validations=1)
    search(run, 2, tmp_path / "study")
    path = tmp_path / "study" / task_name(run) / START
    before = path.read_bytes(), path.stat().st_mtime_ns
    search(run, 3, tmp_path / "study")
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before
    assert len({trial.intermediate_values[0] for trial in trials_in(run, tmp_path / "study")}) == 1
    given = small_run(tmp_path, "ppo", PRETRAINED, steps=128, validations=1, start=path)
    others = [given, small_run(tmp_path, "ppo", PRETRAINED, steps=128), small_run(tmp_path, "ppo", steps=128)]
    assert len({task_name(each) for each in (run, *others)}) == 4
    run_folder = tmp_path / "run"
    train(run, run_folder)
    another = small_run(tmp_path, "ppo", PRETRAINED, steps=128, validations=1, start=run_folder)
    assert task_name(another) == task_name(given)  # what counts is the actor, wherever it is
    search(given, 1, tmp_path / "given")
    assert [entry.name for entry in sorted((tmp_path / "given").iterdir())] == [BEST, JOURNAL]


def command(folder: Path, *options: str) -> list[str]:
    """The command line of a small search."""
    small_run(folder, "ppo")
    (folder / "agent.yaml").write_text(SMALL["ppo"])
    given = ("--steps", "128", "--validations", "1", "--validation-episodes", "4")
    paths = ("--config", str(folder / "agent.yaml"), "--out", str(folder / "study"))
    return ["tune", "ppo", str(folder / "scenario.yaml"), *given, *paths, *options]


def test_the_command_tells_and_goes_on_after_an_interrupt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C in the second training: the first trial is kept, and the same command ends the search."""
    trained: list[Run] = []

    def interrupted(run: Run, folder: Path, **options: Any) -> str:
        trained.append(run)
        outcome = train(run, folder, **options)
        return "interrupted" if len(trained) == 2 else outcome

    monkeypatch.setattr(searching, "train", interrupted)
    result = CliRunner().invoke(app, command(tmp_path, "--trials", "3"))
    assert result.exit_code == INTERRUPTED
    assert "interrupted; finished trials are saved in" in result.stderr
    assert "best of 1 trials: " in result.stdout
    result = CliRunner().invoke(app, command(tmp_path, "--trials", "3"))
    assert result.exit_code == 0, result.output
    assert f"; the hyperparameters are {tmp_path / 'study' / BEST}" in result.stdout
    assert len(trained) == 4


def test_mistakes_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is no journal, an actor that is not there, and no Optuna."""
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / JOURNAL).write_text("trials")
    assert_refused(command(tmp_path), "trials.journal: no Optuna journal, or damaged")
    assert_refused(command(tmp_path, "--start", str(tmp_path / "none.safetensors")), "none.safetensors")
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert_refused(command(tmp_path), "needs optuna; in a checkout: pip install -e '.[optimal]', or make")


def test_a_damaged_journal_is_refused_or_gives_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A byte inverted or a cut in the journal: one line that names it, or the result of the whole journal."""
    monkeypatch.setattr(searching, "train", bowl)
    run, journal = small_run(tmp_path, "ppo"), tmp_path / "study" / JOURNAL
    result = search(run, 2, tmp_path / "study")
    content = journal.read_bytes()

    def read() -> None:
        assert search(run, 2, tmp_path / "study") == result

    assert len(refusals(journal, content, read, len(content), stride=37, cuts=10)) > len(content) / 37 / 2
