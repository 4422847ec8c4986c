"""Training: a model, its batched environment and its validation, from start to end, or from stop to stop."""

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
from agents.pretraining.pretrain import pretrain
from agents.training.checkpoint import State, load_checkpoint, restore
from agents.training.run_folder import CHECKPOINT, PRETRAINING, START, TENSORBOARD, Run, load_run, start_file, start_run
from agents.training.validation import Outcome, Validation
from agents.training.warm_start import start_from
from formation_env.evaluation.seeds import seeds
from formation_env.files import write_files
from formation_env.settings import ConfigError


def training_seeds(seed: int, rows: int) -> range:
    """Seeds of the rows' environments: of the training split, and others for each seed of a run.

    Raises:
        ConfigError: there are not so many.
    """
    try:
        return seeds("training", (seed + 1) * rows)[-rows:]
    except ValueError:
        raise ConfigError(f"seed: no training seeds are left for {rows} rows, got {seed}") from None


Lines = Sequence[Mapping[str, float]]
"""Of a learning curve, see `Validation`."""


def _never(lines: Lines) -> bool:
    return False


def train(run: Run, folder: Path, time_limit_s: float = math.inf, give_up: Callable[[Lines], bool] = _never) -> Outcome:
    """Train as the run says, and keep all in its folder. An interrupt (Ctrl-C) saves and ends.

    Args:
        run: what to train.
        folder: of the run; must not hold one yet.
        time_limit_s: the training stops before the first rollout after this time; s.
        give_up: asked before each rollout whether to stop for good, told the learning curve up to there.

    Returns:
        Why it ended.

    Raises:
        ConfigError: the folder holds a run already, the seed is too large, or the actor to start from does not fit.
        OSError: the folder cannot be written.
    """
    training_seeds(run.seed, run.agent.rows)
    start = start_file(run)
    if run.agent.pretraining is None or start:
        model = _new_model(run, start)
        start_run(run, folder)
    else:
        start_run(run, folder)
        model = _new_model(run, pretrained(run, folder))
    return _learn(model, run, folder, None, time_limit_s, give_up)


def resume(folder: Path, time_limit_s: float = math.inf) -> Outcome:
    """Go on with a run from its last checkpoint, as if it had never stopped.

    Args:
        folder: of the run.
        time_limit_s: as in `train`, from now on.

    Returns:
        Why it ended.

    Raises:
        ConfigError: no run is there, or one of its files is faulty.
        OSError: the folder cannot be written.
    """
    run = load_run(folder)
    model = _new_model(run, pretrained(run, folder) if run.agent.pretraining or run.start else None)
    state = load_checkpoint(folder / CHECKPOINT) if (folder / CHECKPOINT).exists() else None
    if state is not None:
        restore(model, state)
    return _learn(model, run, folder, state, time_limit_s)


def pretrained(run: Run, folder: Path) -> Path:
    """The actor in a run's folder that it starts from; made, if it is not there yet."""
    path, agent = folder / START, run.agent
    if agent.pretraining is not None and not path.exists():
        torch.set_num_threads(run.threads)
        functions = Functions(agent.network.activation, "tanh", agent.throttle_power, agent.magnification)
        told = Judgements(run.validation_episodes)
        actor = pretrain(
            agent.pretraining, agent.network, functions, run.scenario, run.seed, run.validation_episodes, told.note
        )
        write_files(folder, {START: to_bytes(actor), PRETRAINING: told.csv().encode()})  # the first appears last
    return path


class Judgements:
    """What pretraining came to, from time to time; the clock starts with the object."""

    def __init__(self, episodes: int) -> None:
        self._episodes = episodes
        self._start_s = time.perf_counter()
        self._lines: list[tuple[str, float, float]] = []

    def note(self, done: str, cost: float) -> None:
        """Remember and show what has been done, and the mean validation cost that it came to, m/s."""
        self._lines.append((done, round(time.perf_counter() - self._start_s, 1), -cost))
        tqdm.write(f"{done}: {cost:.4f} m/s on {self._episodes} validation seeds")

    def csv(self) -> str:
        """The file `PRETRAINING`; its last line is the end, where all that is done is judged."""
        table = pd.DataFrame(self._lines, columns=["done", "seconds", "return"])
        return table.to_csv(index=False, float_format="%.6g")


def _new_model(run: Run, start: Path | None) -> BaseAlgorithm:
    """A model before its first step, with the actor of a file if there is one to start from."""
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
    give_up: Callable[[Lines], bool] = _never,
) -> Outcome:
    """Train up to the run's last step, or until it has to end."""
    model.set_logger(configure(str(folder / TENSORBOARD), ["tensorboard"]))
    ends_s = time.perf_counter() + time_limit_s
    with _stop_asked() as stop, _bar(run, model.num_timesteps) as bar:

        def must_end() -> Outcome | None:
            if stop.is_set():
                return "interrupted"
            if give_up(validation.lines):
                return "given up"
            return "out of time" if time.perf_counter() > ends_s else None

        validation = Validation(run, folder, bar, must_end, state)
        try:
            model.learn(run.steps - model.num_timesteps, validation, reset_num_timesteps=state is None)
            if validation.outcome is None:
                validation.note()
        except KeyboardInterrupt:  # the second one; the last checkpoint stays
            validation.outcome = "interrupted"
        finally:
            model.logger.close()
    return validation.outcome or "finished"


def _bar(run: Run, done: int) -> "tqdm[Any]":
    return tqdm(total=run.steps, initial=done, unit="step", unit_scale=True, dynamic_ncols=True, smoothing=0.1)


@contextlib.contextmanager
def _stop_asked() -> Iterator[threading.Event]:
    """Ctrl-C and SIGTERM ask to stop where the model is whole; the second one interrupts at once, as ever."""
    asked = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def ask(number: int, frame: object) -> None:
        asked.set()
        put_back()

    def put_back() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    try:
        for number in before:
            signal.signal(number, ask)
        yield asked
    finally:
        put_back()
