"""Training: a model, its batched environment and its validation, from the start or from a checkpoint to the end."""

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import configure
from tqdm import tqdm

from agents.algorithms.models import make_env, make_model
from agents.policy.actor import Functions, to_bytes
from agents.pretraining.pretrain import check_pretraining, pretrain
from agents.training.checkpoint import State, load_checkpoint, restore
from agents.training.run_folder import (
    CHECKPOINT,
    PRETRAINING,
    START,
    TENSORBOARD,
    Run,
    check_new,
    load_run,
    start_file,
    start_run,
)
from agents.training.validation import Outcome, Validation
from agents.training.warm_start import start_from
from formation_env.evaluation.seeds import seeds
from formation_env.files import write_files
from formation_env.settings import ConfigError


def training_seeds(seed: int, rows: int) -> range:
    """Seeds of the rows' environments: of the training split, and different for each seed of a run.

    Raises:
        ConfigError: there are not so many.
    """
    try:
        return seeds("training", (seed + 1) * rows)[-rows:]
    except ConfigError:
        raise ConfigError(f"seed: no training seeds are left for {rows} rows, got {seed}") from None


Curve = Sequence[Mapping[str, float]]
"""Learning curve up to now, see `Validation`."""


def _never(curve: Curve) -> bool:
    return False


def check_run(run: Run) -> None:
    """Refuse a run that would fail later, before any work is done.

    Raises:
        ConfigError: too few seeds for the run, or a scenario that pretraining cannot differentiate; one line.
    """
    training_seeds(run.seed, run.agent.rows)
    try:
        seeds("validation", run.validation_episodes)
    except ConfigError as error:
        raise ConfigError(f"validation_episodes: {error}") from None
    if run.agent.pretraining is not None and not run.start:
        check_pretraining(run.agent.pretraining, run.scenario, run.seed)


def train(run: Run, folder: Path, time_limit_s: float = math.inf, give_up: Callable[[Curve], bool] = _never) -> Outcome:
    """Train with a run's settings and keep the results in its folder. Ctrl-C saves a checkpoint and ends.

    Args:
        run: settings.
        folder: of the run; must not hold one yet.
        time_limit_s: the training stops before the first rollout after this time; s.
        give_up: called before each rollout with the learning curve; True ends the training.

    Returns:
        Reason for the end.

    Raises:
        ConfigError: the folder holds a run already, the run fails `check_run`, or the actor to start from does not
            fit.
        OSError: the folder cannot be written.
    """
    check_new(folder)
    check_run(run)
    start = start_file(run)
    if run.agent.pretraining is None or start:
        model = _new_model(run, start)
        start_run(run, folder)
    else:
        start_run(run, folder)
        model = _new_model(run, pretrained(run, folder))
    return _learn(model, run, folder, None, time_limit_s, give_up)


def resume(folder: Path, time_limit_s: float = math.inf) -> Outcome:
    """Continue a run from its last checkpoint; the result has the same bits as without the interruption.

    Args:
        folder: of the run.
        time_limit_s: as in `train`, counted from now.

    Returns:
        Reason for the end.

    Raises:
        ConfigError: the folder holds no run, or one of its files is faulty.
        OSError: the folder cannot be written.
    """
    run = load_run(folder)
    checkpoint = folder / CHECKPOINT
    state = load_checkpoint(checkpoint, run) if checkpoint.exists() else None
    model = _new_model(run, pretrained(run, folder) if run.agent.pretraining or run.start else None)
    if state is not None:
        restore(model, state)
    return _learn(model, run, folder, state, time_limit_s)


def pretrained(run: Run, folder: Path) -> Path:
    """File of the actor that a run starts from, in the run's folder; pretrained now if it does not exist."""
    path, agent = folder / START, run.agent
    if agent.pretraining is not None and not path.exists():
        torch.set_num_threads(run.threads)
        functions = Functions(agent.network.activation, "tanh", agent.throttle_power, agent.magnification)
        log = PretrainingLog(run.validation_episodes)
        actor = pretrain(
            agent.pretraining,
            agent.network,
            functions,
            run.scenario,
            seed=run.seed,
            validation_episodes=run.validation_episodes,
            progress=log.add,
        )
        # Files are renamed last to first: an actor never lies in the folder without its log.
        write_files(folder, {START: to_bytes(actor), PRETRAINING: log.to_csv().encode()})
    return path


class PretrainingLog:
    """Validation costs during pretraining; the clock starts with the object."""

    def __init__(self, episodes: int) -> None:
        self._episodes = episodes
        self._start_s = time.perf_counter()
        self._lines: list[tuple[str, float, float]] = []

    def add(self, stage: str, cost: float) -> None:
        """Record and print the mean validation cost after a stage, m/s."""
        self._lines.append((stage, time.perf_counter() - self._start_s, -cost))
        tqdm.write(f"{stage}: {cost:.4f} m/s on {self._episodes} validation seeds")

    def to_csv(self) -> str:
        """Content of the file `PRETRAINING`; its last line is the end of the pretraining."""
        table = pd.DataFrame(self._lines, columns=["done", "seconds", "return"])
        return table.to_csv(index=False, float_format="%.6g")


def _new_model(run: Run, start: Path | None) -> BaseAlgorithm:
    """Build a model before its first step, with the actor of a file if one is given."""
    first = training_seeds(run.seed, run.agent.rows)[0]
    torch.set_num_threads(run.threads)
    env = make_env(run.agent, run.scenario)
    model = make_model(run.agent, env, run.seed)
    env.seed(first)
    if start is not None:
        start_from(start, model, run.agent, run.scenario)
    return model


def _learn(
    model: BaseAlgorithm,
    run: Run,
    folder: Path,
    state: State | None,
    time_limit_s: float,
    give_up: Callable[[Curve], bool] = _never,
) -> Outcome:
    """Train up to the run's last step, or until something ends it earlier."""
    model.set_logger(configure(str(folder / TENSORBOARD), ["tensorboard"]))
    ends_s = time.perf_counter() + time_limit_s
    with _stop_requested() as stop, _bar(run, model.num_timesteps) as bar:

        def reason_to_end() -> Outcome | None:
            if stop.is_set():
                return "interrupted"
            if give_up(validation.lines):
                return "given up"
            return "out of time" if time.perf_counter() > ends_s else None

        validation = Validation(run, folder, bar, reason_to_end, state)
        try:
            model.learn(run.steps - model.num_timesteps, validation, reset_num_timesteps=state is None)
            if validation.outcome is None:
                validation.run_now()
        except KeyboardInterrupt:  # a second Ctrl-C; the last checkpoint remains
            validation.outcome = "interrupted"
        finally:
            model.logger.close()
    return validation.outcome or "finished"


def _bar(run: Run, done: int) -> "tqdm[Any]":
    return tqdm(total=run.steps, initial=done, unit="step", unit_scale=True, dynamic_ncols=True, smoothing=0.1)


@contextlib.contextmanager
def _stop_requested() -> Iterator[threading.Event]:
    """The first Ctrl-C or SIGTERM requests a stop between two rollouts; the second one interrupts at once."""
    requested = threading.Event()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def request(number: int, frame: object) -> None:
        requested.set()
        restore_handlers()

    def restore_handlers() -> None:
        for number, handler in handlers.items():
            signal.signal(number, handler)

    try:
        for number in handlers:
            signal.signal(number, request)
        yield requested
    finally:
        restore_handlers()
