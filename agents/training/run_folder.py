"""A training run's folder: what is in it, and how a model is saved to it and loaded from it."""

import json
import platform
import subprocess
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Final, Self

import pandas as pd
from pydantic import Field, Strict, model_validator

from agents.hyperparameters import SETTINGS, AgentSettings, Algorithm, SACSettings
from agents.policy.actor import Actor, read_actor
from formation_env.files import replacing, write_files
from formation_env.settings import ConfigError, Text, build, load_json, settings
from formation_env.task.scenario import Scenario

MODEL: Final = "model.zip"
"""The model that was best on the validation seeds, as Stable-Baselines3 saves it."""
BEST: Final = "best.safetensors"
"""Its actor alone, see `agents.policy.actor`."""
START: Final = "start.safetensors"
"""A copy of the actor that the run started from."""
CHECKPOINT: Final = "checkpoint.pt"
RUN: Final = "settings.json"
CURVE: Final = "validation.csv"
PRETRAINING: Final = "pretraining.csv"
"""What came before, if anything did: done, seconds and return of each judgement; the last one is its end."""
PRETRAINED_BY: Final = ("pretraining", "network", "throttle_power", "magnification")
"""Hyperparameters that a pretrained actor depends on."""
TENSORBOARD: Final = "tensorboard"

LIBRARIES: Final = ("formation-env", "gymnasium", "numpy", "stable-baselines3", "torch")


@settings
class Run:
    """All that made a run, so that it can be redone and its models need nothing else.

    Attributes:
        algorithm: which.
        env: the environment as it was asked for.
        seed: of the training.
        steps: environment steps to train for.
        validation_episodes: episodes of each validation.
        validations: validations, evenly over the run.
        threads: of torch; other numbers give other rounding.
        agent: the hyperparameters.
        scenario: what is flown.
        start: path of the actor that it starts from, or of the run whose pretrained actor that is, if it does.
        command: the command line.
        versions: of the libraries, and the revision of the sources.
    """

    algorithm: Algorithm
    env: Text
    seed: Annotated[int, Strict(), Field(ge=0)] = 0
    steps: Annotated[int, Strict(), Field(ge=1)]
    validation_episodes: Annotated[int, Strict(), Field(ge=2)] = 64
    validations: Annotated[int, Strict(), Field(ge=1)] = 20
    threads: Annotated[int, Strict(), Field(ge=1)] = 1
    agent: AgentSettings
    scenario: Scenario
    start: Text = ""
    command: Text = ""
    versions: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse critics of after-states where a thrust leads elsewhere in each variant of the scenario."""
        if self.scenario.domain_randomization and isinstance(self.agent, SACSettings) and self.agent.after_state:
            raise ValueError("agent.after_state: must be false for a scenario with domain_randomization, got true")
        return self


def versions() -> dict[str, str]:
    """Versions of the interpreter and of the libraries behind a model, and git's revision of a checkout."""
    libraries = {name: metadata.version(name) for name in LIBRARIES}
    return {"python": platform.python_version()} | libraries | {"git": _revision(Path(__file__).parent)}


def _revision(folder: Path) -> str:
    """What git calls the sources, `-dirty` if they were changed since; empty where there is no git."""
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=40"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def start_run(run: Run, folder: Path) -> None:
    """Make a run's folder and write its settings, and a copy of the actor that it starts from.

    Raises:
        ConfigError: the folder holds a run already.
        OSError: it cannot be written.
    """
    if (folder / RUN).exists():
        raise ConfigError(f"{folder}: holds a run already; go on with --resume {folder}, or give another folder")
    files = {RUN: (json.dumps(asdict(run), indent=2) + "\n").encode()}
    if run.start:
        files |= _given(Path(run.start))
    write_files(folder, files)


def _given(start: Path) -> dict[str, bytes]:
    """What a run takes from its start: an actor's file, or another run's pretrained actor and how it came about."""
    if not start.is_dir():
        return {START: start.read_bytes()}
    return {name: (start / name).read_bytes() for name in (START, PRETRAINING)}


def start_file(run: Run) -> Path | None:
    """The file of the actor that a run starts from, if one is given.

    Raises:
        ConfigError: it is another run's, which was pretrained in another way.
    """
    start = Path(run.start)
    if not run.start or not start.is_dir():
        return start if run.start else None
    theirs = load_run(start)
    if theirs.scenario != run.scenario:
        raise ConfigError(f"{start}: is of {theirs.env}; its scenario must be this run's, {run.env}")
    pairs = {"seed": (run.seed, theirs.seed)}
    pairs |= {key: (getattr(run.agent, key), getattr(theirs.agent, key)) for key in PRETRAINED_BY}
    for key, (wanted, got) in pairs.items():
        if wanted != got:
            raise ConfigError(f"{start}: {key}: must be this run's, {wanted}, got {got}")
    return start / START


def load_run(folder: Path) -> Run:
    """A run's settings.

    Raises:
        ConfigError: no run is there, or its settings are wrong; one line.
    """
    path = folder / RUN
    data = load_json(path)
    if isinstance(data, dict) and data.get("algorithm") in SETTINGS:
        data["agent"] = build(SETTINGS[data["algorithm"]], data.get("agent"), f"{path}: agent")
    return build(Run, data, str(path))


def save_model(model: Any, path: Path) -> None:
    """Save an SB3 model at once: interrupted, it leaves the old one.

    Raises:
        OSError: the folder cannot be written.
    """
    with replacing(path) as temporary:
        model.save(temporary)


def load_best(folder: Path) -> tuple[Run, Actor]:
    """A run and the policy that was best on its validation seeds. Nothing is unpickled.

    Raises:
        ConfigError: no run or no policy is there, or a file is damaged; one line.
    """
    run = load_run(folder)
    return run, read_actor(folder / BEST, run.scenario)


def read_curve(folder: Path) -> pd.DataFrame:
    """A run's validations, one line each.

    Raises:
        ConfigError: there are none.
    """
    return _read_lines(folder / CURVE)


def read_pretraining(folder: Path) -> pd.DataFrame | None:
    """The judgements during a run's pretraining, one line each; None if the run has no such file.

    Raises:
        ConfigError: the file cannot be read.
    """
    path = folder / PRETRAINING
    return _read_lines(path) if path.exists() else None


def _read_lines(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except pd.errors.EmptyDataError:
        raise ConfigError(f"{path}: has no validation yet") from None
