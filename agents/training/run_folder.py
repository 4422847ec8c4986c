"""Folder of a training run: its files, and how models are saved to it and loaded from it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Final, Self

import numpy as np
import pandas as pd
from pydantic import Field, Strict, model_validator

from agents.algorithms.registry import ALGORITHMS, algorithm_settings
from agents.hyperparameters import VALIDATION_EPISODES, VALIDATIONS, CommonSettings, NonNegativeInt, PositiveInt
from agents.policy.actor import Actor, read_actor
from formation_env.files import replacing, write_files
from formation_env.settings import ConfigError, Text, build, load_json, settings
from formation_env.task.scenario import Scenario

MODEL: Final = "model.zip"
"""Best model on the validation seeds in Stable-Baselines3's format; its `predict` gives the environment's actions."""
BEST: Final = "best.safetensors"
"""Actor of that model, see `agents.policy.actor`."""
START: Final = "start.safetensors"
"""Copy of the actor that the run started from."""
CHECKPOINT: Final = "checkpoint.pt"
RUN: Final = "settings.json"
CURVE: Final = "validation.csv"
PRETRAINING: Final = "pretraining.csv"
"""Log of the pretraining, if there was any: stage, seconds and return of each validation; the last line is its end."""
PRETRAINED_BY: Final = ("pretraining", "network", "throttle_power", "magnification")
"""Hyperparameters that a pretrained actor depends on."""
TENSORBOARD: Final = "tensorboard"
DIGEST: Final = "sha256"
"""Key of the settings' own hash in `RUN`: settings that have changed since do not belong to the run's other files."""

CURVE_COLUMNS: Final = ("steps", "seconds", "return")
PRETRAINING_COLUMNS: Final = ("seconds", "return")
"""Columns that must hold finite numbers; `CURVE` has further metrics, `PRETRAINING` a text in `done`."""


@settings
class Run:
    """Complete settings of a run: enough to repeat it and to use its models.

    Attributes:
        algorithm: name of the algorithm.
        env: environment as the user named it.
        seed: seed of the training.
        steps: environment steps to train for.
        validation_episodes: episodes of each validation.
        validations: number of validations, evenly spaced over the run.
        threads: threads of torch; another number rounds differently.
        agent: hyperparameters.
        scenario: task that is flown.
        start: path of the actor that the run starts from, or of a run whose pretrained actor it takes; empty for none.
        command: command line.
        versions: versions of the libraries, and git revision of the sources.
    """

    algorithm: Text
    env: Text
    seed: NonNegativeInt = 0
    steps: PositiveInt
    validation_episodes: Annotated[int, Strict(), Field(ge=2)] = VALIDATION_EPISODES
    validations: PositiveInt = VALIDATIONS
    threads: PositiveInt = 1
    agent: CommonSettings
    scenario: Scenario
    start: Text = ""
    command: Text = ""
    versions: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse hyperparameters of another algorithm, or ones that cannot train on the scenario."""
        if type(self.agent) is not ALGORITHMS.get(self.algorithm):
            raise ValueError(f"agent: must be the hyperparameters of {self.algorithm}, got {type(self.agent).__name__}")
        self.agent.check_scenario(self.scenario)
        return self


def run_sha256(run: Run) -> str:
    """Identity of a run: the hash of its settings."""
    return _digest(asdict(run))


def _digest(data: Mapping[str, Any]) -> str:
    """Hash of settings as plain data, without a hash that they contain."""
    content = {key: value for key, value in data.items() if key != DIGEST}
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def start_run(run: Run, folder: Path) -> None:
    """Make a run's folder, write its settings, and copy the actor that it starts from.

    Raises:
        ConfigError: the folder already holds a run.
        OSError: it cannot be written.
    """
    check_new(folder)
    files = {RUN: (json.dumps(asdict(run) | {DIGEST: run_sha256(run)}, indent=2) + "\n").encode()}
    if run.start:
        files |= _start_files(Path(run.start))
    write_files(folder, files)


def check_new(folder: Path) -> None:
    """Refuse a folder that already holds a run.

    Raises:
        ConfigError: it does.
    """
    if (folder / RUN).exists():
        raise ConfigError(f"{folder}: holds a run already; continue it with --out {folder} --resume, or name another")


def _start_files(start: Path) -> dict[str, bytes]:
    """Files that a run copies from its start: an actor, or another run's pretrained actor with its log."""
    if not start.is_dir():
        return {START: start.read_bytes()}
    return {name: (start / name).read_bytes() for name in (START, PRETRAINING)}


def start_file(run: Run) -> Path | None:
    """File of the actor that a run starts from, if one is given.

    Raises:
        ConfigError: it belongs to another run that was pretrained differently.
    """
    start = Path(run.start)
    if not run.start or not start.is_dir():
        return start if run.start else None
    other = load_run(start)
    if other.scenario != run.scenario:
        raise ConfigError(f"{start}: was trained on {other.env}; its scenario must be this run's, {run.env}")
    pairs = {"seed": (run.seed, other.seed)}
    pairs |= {key: (getattr(run.agent, key), getattr(other.agent, key)) for key in PRETRAINED_BY}
    for key, (expected, given) in pairs.items():
        if expected != given:
            raise ConfigError(f"{start}: {key}: must be this run's, {expected}, got {given}")
    return start / START


def load_run(folder: Path) -> Run:
    """Read a run's settings.

    Raises:
        ConfigError: the folder holds no run, or its settings are faulty or were changed; one line.
    """
    path = folder / RUN
    data = load_json(path)
    if not isinstance(data, dict) or "algorithm" not in data:
        raise ConfigError(f"{path}: algorithm: missing, so this is not a run's settings")
    try:
        data["agent"] = build(algorithm_settings(str(data["algorithm"])), data.get("agent"), "agent")
    except ConfigError as error:
        raise ConfigError("\n".join(f"{path}: {line}" for line in str(error).splitlines())) from None
    digest = data.pop(DIGEST, None)
    run = build(Run, data, str(path))
    if digest != run_sha256(run):
        raise ConfigError(f"{path}: {DIGEST}: does not match; the settings were damaged or changed after the start")
    return run


def save_model(model: Any, path: Path) -> None:
    """Save an SB3 model atomically: if interrupted, the old file remains.

    Raises:
        OSError: the folder cannot be written.
    """
    with replacing(path) as temporary:
        model.save(temporary)


def load_best(folder: Path) -> tuple[Run, Actor]:
    """Load a run and its best policy on the validation seeds. Nothing is unpickled.

    Raises:
        ConfigError: the folder holds no run or no policy, or a file is damaged; one line.
    """
    run = load_run(folder)
    return run, read_actor(folder / BEST, run.scenario)


def read_curve(folder: Path) -> pd.DataFrame:
    """Read a run's validations, one row each.

    Raises:
        ConfigError: there are none, or the file is damaged.
    """
    path = folder / CURVE
    table = _read_table(path, CURVE_COLUMNS)
    if (table["steps"].diff()[1:] <= 0).any():
        raise ConfigError(f"{path}: steps: must increase from line to line")
    return table


def read_pretraining(folder: Path) -> pd.DataFrame | None:
    """Read the validations of a run's pretraining, one row each; None without such a file.

    Raises:
        ConfigError: the file cannot be read, or is damaged.
    """
    path = folder / PRETRAINING
    return _read_table(path, PRETRAINING_COLUMNS) if path.exists() else None


def _read_table(path: Path, numeric: tuple[str, ...]) -> pd.DataFrame:
    """A CSV file with at least one row, whose named columns hold finite numbers."""
    try:
        table = pd.read_csv(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except pd.errors.EmptyDataError:
        raise ConfigError(f"{path}: has no validation yet") from None
    except ValueError as error:  # among them pandas' ParserError and UnicodeDecodeError
        raise ConfigError(f"{path}: damaged: {' '.join(str(error).split())[:80]}") from None
    for name in numeric:
        if name not in table:
            raise ConfigError(f"{path}: {name}: this column is missing")
        if table[name].dtype.kind not in "if" or not np.isfinite(table[name]).all():
            raise ConfigError(f"{path}: {name}: must hold finite numbers only")
    if table.empty:
        raise ConfigError(f"{path}: has no validation yet")
    return table
