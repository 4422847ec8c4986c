"""Export of the best training run as a policy's files: chosen on validation seeds, then tested on test seeds."""

import itertools
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from scipy import stats

from agents.policy.actor import Actor, read_actor, to_bytes
from agents.policy.library import CARD, GRAPH, TENSORS, Card, Interval, Trained, load_with_card, policy_name, sha256
from agents.policy.onnx_export import to_onnx
from agents.training.run_folder import START, Run, load_best, read_curve, read_pretraining
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import paired_difference, summarise
from formation_env.files import write_files
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE

VALIDATION_EPISODES: Final = 500
"""More than in a training: the best of many validations is biased upwards on the episodes that chose it."""
TEST_EPISODES: Final = 100
LISTED_EPISODES: Final = 5
"""Test episodes whose costs the card lists one by one."""


TWO_SIDED_95: Final = 0.975
"""Quantile of a two-sided 95 % interval."""


@dataclass(frozen=True)
class Candidate:
    """Run that may be shipped.

    Attributes:
        run: settings.
        actor: best policy.
        trained: results.
        episodes: test episodes.
    """

    run: Run
    actor: Actor
    trained: Trained
    episodes: pd.DataFrame


def export(folders: Sequence[Path], out: Path) -> Path:
    """Write tensors, card and graph of the run with the lowest cost on the validation seeds.

    Args:
        folders: of runs of one algorithm on one environment, with different training seeds.
        out: folder of the files; made if it does not exist. Files of the same name are replaced.

    Returns:
        Path of the tensors.

    Raises:
        ConfigError: a faulty run, or runs that do not belong together; one line.
        OSError: the folder cannot be written; its files are unchanged then.
    """
    candidates = [_test(*opened) for opened in _open(folders)]
    candidates.sort(key=lambda candidate: candidate.trained.validation_cost_m_s)
    best = candidates[0]
    tensors = to_bytes(best.actor)
    card = _card(candidates, tensors)
    name = policy_name(best.run.algorithm, best.run.env)
    files = {TENSORS: tensors, CARD: _written(card), GRAPH: to_onnx(best.actor)}
    write_files(out, {f"{name}{ending}": content for ending, content in files.items()})
    return out / f"{name}{TENSORS}"


def renew(path: Path) -> None:
    """Fly a policy on the test seeds again, after a change of the environment, and renew its card's test results.

    What the card says of the training runs stays: their policies are not at hand.

    Args:
        path: of the tensors.

    Raises:
        ConfigError: faulty files, or the card's environment is another one now; one line.
        OSError: the card cannot be written; it is unchanged then.
    """
    actor, card = load_with_card(path)
    episodes = evaluate(actor, card.scenario, seeds("test", card.test_episodes))
    write_files(path.parent, {path.with_suffix(CARD).name: _written(_tested(card, episodes))})


def _tested(card: Card, episodes: pd.DataFrame) -> Card:
    """The card with the results of its test episodes."""
    costs = -episodes["return"].to_numpy(float)
    return replace(card, test=_intervals(episodes), first_test_costs_m_s=tuple(costs[:LISTED_EPISODES].tolist()))


def _written(card: Card) -> bytes:
    return (json.dumps(asdict(card), indent=2, allow_nan=False) + "\n").encode()


def _open(folders: Sequence[Path]) -> list[tuple[Path, Run, Actor]]:
    """Folders with their runs and best policies.

    Raises:
        ConfigError: two runs differ in more than their seeds, or have equal seeds.
    """
    opened = [(folder, *load_best(folder)) for folder in folders]
    for (one, run, _), (other, another, _) in itertools.combinations(opened, 2):
        if (run.algorithm, run.env, run.scenario) != (another.algorithm, another.env, another.scenario):
            second, first = f"{another.algorithm} on {another.env}", f"{run.algorithm} on {run.env}"
            raise ConfigError(f"{other}: is a run of {second}, but {one} of {first}")
        if run.seed == another.seed:
            raise ConfigError(f"{other}: has the training seed {run.seed}, as {one} has; each run must have its own")
    return opened


def _test(folder: Path, run: Run, actor: Actor) -> Candidate:
    """Evaluate a policy on the validation and on the test seeds."""
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
    """Time that the pretraining took, s; None if unknown, as for a given actor."""
    log = read_pretraining(folder)
    if log is not None:
        return float(log["seconds"].max())
    return None if run.agent.pretraining or run.start else 0.0


def _saved(folder: Path, run: Run, episodes: pd.DataFrame) -> Interval | None:
    """Reduction of the test cost since the actor that the run started from; None if there was none."""
    if not (folder / START).exists():
        return None
    start = evaluate(read_actor(folder / START, run.scenario), run.scenario, seeds("test", TEST_EPISODES))
    mean, low, high = paired_difference(episodes, start)
    return Interval(mean=mean, low=low, high=high)


def _cost(episodes: pd.DataFrame) -> Interval:
    """Mean cost with its interval, minus the return."""
    returned = _intervals(episodes)["return"]
    return Interval(mean=-returned.mean, low=-returned.high, high=-returned.low)


def _intervals(episodes: pd.DataFrame) -> dict[str, Interval]:
    """Mean and interval of each metric."""
    return {
        str(name): Interval(mean=float(row["mean"]), low=float(row["low"]), high=float(row["high"]))
        for name, row in summarise(episodes).iterrows()
    }


def _card(candidates: Sequence[Candidate], tensors: bytes) -> Card:
    best = candidates[0]
    training = {key: value for key, value in asdict(best.run).items() if key not in ("algorithm", "env", "scenario")}
    return Card(
        algorithm=best.run.algorithm,
        env=best.run.env,
        observation_size=SIZE,
        sha256=sha256(tensors),
        test=_intervals(best.episodes),
        test_episodes=TEST_EPISODES,
        first_test_costs_m_s=tuple(-best.episodes["return"].to_numpy(float)[:LISTED_EPISODES]),
        cost_over_runs_m_s=_over_runs([candidate.trained.test_cost_m_s.mean for candidate in candidates]),
        runs=tuple(candidate.trained for candidate in candidates),
        training=training,
        scenario=best.run.scenario,
    )


def _over_runs(costs: Sequence[float]) -> Interval | None:
    """Mean over training seeds with Student's interval; a bootstrap of so few values would be far too narrow."""
    if len(costs) < 2:
        return None
    mean = float(np.mean(costs))
    half = float(stats.t.ppf(TWO_SIDED_95, len(costs) - 1) * stats.sem(costs))
    return Interval(mean=mean, low=mean - half, high=mean + half)
