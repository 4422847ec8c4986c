"""From training runs to a policy's files: choose on validation seeds, judge once on test seeds, write all at once."""

import itertools
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from scipy import stats

from agents.policy.actor import Actor, read_actor, to_bytes
from agents.policy.library import CARD, GRAPH, TENSORS, Card, Interval, Trained, policy_name, sha256
from agents.policy.onnx_export import to_onnx
from agents.training.run_folder import START, Run, load_best, read_curve, read_pretraining
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import paired_difference, summarise
from formation_env.files import write_files
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE

VALIDATION_EPISODES: Final = 500
"""More than a training flies: the best of many validations looks better than it is."""
TEST_EPISODES: Final = 100
FIRST: Final = 5
"""Test episodes whose costs the card has one by one."""


@dataclass(frozen=True)
class Candidate:
    """A run that may be shipped.

    Attributes:
        run: its settings.
        actor: its best policy.
        trained: what it came to.
        episodes: its test episodes.
    """

    run: Run
    actor: Actor
    trained: Trained
    episodes: pd.DataFrame


def export(folders: Sequence[Path], out: Path) -> Path:
    """Write the tensors, the card and the graph of the run that is best on the validation seeds.

    Args:
        folders: of runs of one algorithm on one environment, each with a training seed of its own.
        out: folder of the files; made if it does not exist. Files of the same name are replaced.

    Returns:
        Path of the tensors.

    Raises:
        ConfigError: a faulty run, or runs that do not belong together; one line.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    candidates = [_examine(*opened) for opened in _open(folders)]
    candidates.sort(key=lambda candidate: candidate.trained.validation_cost_m_s)
    best = candidates[0]
    tensors = to_bytes(best.actor)
    card = _card(candidates, tensors)
    name = policy_name(best.run.algorithm, best.run.env)
    text = json.dumps(asdict(card), indent=2, allow_nan=False) + "\n"
    files = {TENSORS: tensors, CARD: text.encode(), GRAPH: to_onnx(best.actor)}
    write_files(out, {f"{name}{ending}": content for ending, content in files.items()})
    return out / f"{name}{TENSORS}"


def _open(folders: Sequence[Path]) -> list[tuple[Path, Run, Actor]]:
    """The folders, with their runs and these's best policies.

    Raises:
        ConfigError: two differ in more than their seeds, or not even in these.
    """
    opened = [(folder, *load_best(folder)) for folder in folders]
    for (one, run, _), (other, another, _) in itertools.combinations(opened, 2):
        if (run.algorithm, run.env, run.scenario) != (another.algorithm, another.env, another.scenario):
            theirs, ours = f"{another.algorithm} on {another.env}", f"{run.algorithm} on {run.env}"
            raise ConfigError(f"{other}: is of {theirs}, but {one} of {ours}")
        if run.seed == another.seed:
            raise ConfigError(f"{other}: has the training seed {run.seed}, as {one} has; each run must have its own")
    return opened


def _examine(folder: Path, run: Run, actor: Actor) -> Candidate:
    """Fly a policy on the validation and on the test seeds."""
    last = read_curve(folder).iloc[-1]
    validation = evaluate(actor, run.scenario, seeds("validation", VALIDATION_EPISODES))
    episodes = evaluate(actor, run.scenario, seeds("test", TEST_EPISODES))
    trained = Trained(
        seed=run.seed,
        steps=int(last["steps"]),
        pretraining_s=_pretraining_s(folder, run),
        wall_time_s=float(last["seconds"]),
        validation_cost_m_s=-float(validation["return"].mean()),
        test_cost_m_s=_cost(episodes),
        saved_m_s=_saved(folder, run, episodes),
    )
    return Candidate(run, actor, trained, episodes)


def _pretraining_s(folder: Path, run: Run) -> float | None:
    """Time until there was an actor to start from, s; None if nobody knows, as where one was given."""
    judged = read_pretraining(folder)
    if judged is not None:
        return float(judged["seconds"].max())
    return None if run.agent.pretraining or run.start else 0.0


def _saved(folder: Path, run: Run, episodes: pd.DataFrame) -> Interval | None:
    """What was learnt after the start, of which there need not be one."""
    if not (folder / START).exists():
        return None
    start = evaluate(read_actor(folder / START, run.scenario), run.scenario, seeds("test", TEST_EPISODES))
    mean, low, high = paired_difference(episodes, start)
    return Interval(mean=mean, low=low, high=high)


def _cost(episodes: pd.DataFrame) -> Interval:
    """Minus the return."""
    mean, low, high = summarise(episodes).loc["return", ["mean", "low", "high"]]
    return Interval(mean=-mean, low=-high, high=-low)


def _card(candidates: Sequence[Candidate], tensors: bytes) -> Card:
    best = candidates[0]
    summary = summarise(best.episodes)[["mean", "low", "high"]]
    training = {key: value for key, value in asdict(best.run).items() if key not in ("algorithm", "env", "scenario")}
    return Card(
        algorithm=best.run.algorithm,
        env=best.run.env,
        observation_size=SIZE,
        sha256=sha256(tensors),
        test={str(name): Interval(**line) for name, line in summary.to_dict(orient="index").items()},
        test_episodes=TEST_EPISODES,
        first_test_costs_m_s=tuple(-best.episodes["return"].to_numpy(float)[:FIRST]),
        cost_over_runs_m_s=_over_runs([candidate.trained.test_cost_m_s.mean for candidate in candidates]),
        runs=tuple(candidate.trained for candidate in candidates),
        training=training,
        scenario=best.run.scenario,
    )


def _over_runs(costs: Sequence[float]) -> Interval | None:
    """Mean over training seeds with Student's interval; the bootstrap of so few would be far too narrow."""
    if len(costs) < 2:
        return None
    mean = float(np.mean(costs))
    half = float(stats.t.ppf(0.975, len(costs) - 1) * stats.sem(costs))
    return Interval(mean=mean, low=mean - half, high=mean + half)
