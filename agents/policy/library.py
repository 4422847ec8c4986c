"""Shipped policies: their files, their cards, and how they are loaded. No torch, no pickle."""

import hashlib
import re
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field

from agents.policy.actor import Actor, read_actor
from formation_env.settings import ConfigError, Real, Text, build, load_json, nearest, settings
from formation_env.task.loading import ENV_IDS, load_scenario, scenario_names
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario

SHIPPED: Final = Path(__file__).parents[1] / "policies"
"""Folder of `ALGORITHM_SCENARIO.safetensors`, each with its card (.json) and the same network as ONNX graph (.onnx)."""
TENSORS, CARD, GRAPH = ".safetensors", ".json", ".onnx"


@settings
class Interval:
    """Mean with its 95 % interval.

    Attributes:
        mean: over the episodes, or over the runs.
        low: lower end.
        high: upper end.
    """

    mean: Real
    low: Real
    high: Real


@settings
class Trained:
    """Results of a training run.

    Attributes:
        seed: of the training.
        steps: environment steps flown.
        pretraining_s: wall time of the pretraining, s; none if unknown.
        wall_time_s: wall time of reinforcement learning, s.
        validation_cost_m_s: mean cost on the validation seeds, which decided which run is shipped, m/s.
        test_cost_m_s: cost on the test seeds, m/s; it decided nothing.
        saved_m_s: reduction of that cost from the actor that the run started from, paired by seed, m/s; none if it
            started from random weights.
    """

    seed: int
    steps: int
    pretraining_s: Real | None
    wall_time_s: Real
    validation_cost_m_s: Real
    test_cost_m_s: Interval
    saved_m_s: Interval | None


@settings
class Card:
    """Description of a policy, in a file beside its tensors.

    Attributes:
        algorithm: name of the training algorithm.
        env: registered id with its version, or a scenario's name or path.
        observation_size: length of the observation that it reads.
        sha256: of the file of tensors.
        test: metric -> mean and interval on the test seeds, bootstrap over episodes; flown again (`agents renew`) when
            the environment's random numbers change, which leaves `runs` as they were measured.
        test_episodes: number of test seeds, from the first on.
        first_test_costs_m_s: costs on the first of them, m/s, for checks.
        cost_over_runs_m_s: mean test cost of all training runs, with Student's interval over runs; none for one run.
        runs: all training runs, the shipped one first.
        training: settings and versions of the shipped run.
        scenario: task that it was trained on.
    """

    algorithm: Text
    env: Text
    observation_size: int
    sha256: Text
    test: dict[str, Interval]
    test_episodes: int
    first_test_costs_m_s: tuple[Real, ...]
    cost_over_runs_m_s: Interval | None
    runs: Annotated[tuple[Trained, ...], Field(min_length=1)]
    training: dict[str, Any]
    scenario: Scenario


def load_policy(source: str | Path, env: str | None = None) -> Actor:
    """Load a learned policy, with the same `predict` as a baseline.

    Args:
        source: the algorithm of a shipped policy, or the path of a .safetensors file with its card beside it.
        env: with an algorithm: a registered id, or the name of a scenario.

    Raises:
        ConfigError: there is none, it does not match its card, or its environment has changed; one line.
    """
    path = Path(source)
    if env is not None:
        path = shipped_path(str(source), env)
    elif path.suffix != TENSORS:
        raise ConfigError(f"{source}: must end in {TENSORS}, or be an algorithm together with an environment")
    return load_with_card(path)[0]


def shipped_path(algorithm: str, env: str) -> Path:
    """Path of a shipped policy.

    Raises:
        ConfigError: there is none.
    """
    path = SHIPPED / f"{policy_name(algorithm, env)}{TENSORS}"
    if not path.is_file():
        known = [found.stem for found in shipped_paths()]
        raise ConfigError(f"no policy of {algorithm!r} for {env!r} is shipped; {nearest(path.stem, known)}")
    return path


def shipped_paths() -> list[Path]:
    """Paths of all shipped policies, sorted by name."""
    return sorted(SHIPPED.glob(f"*{TENSORS}"))


def policy_name(algorithm: str, env: str) -> str:
    """Stem of a policy's files."""
    return f"{algorithm}_{scenario_name(env)}"


def scenario_name(env: str) -> str:
    """Scenario's name for a registered id, a name or a file."""
    return Path(ENV_IDS.get(env, env)).stem


def load_with_card(path: Path) -> tuple[Actor, Card]:
    """Load a policy and its card, and check them against each other and the environment.

    Raises:
        ConfigError: one is missing or faulty, or they do not match; one line.
    """
    digest = _digest_of(path)
    card = read_card(path.with_suffix(CARD))
    if digest != card.sha256:
        raise ConfigError(f"{path}: sha256 is {digest[:12]}..., but its card says {card.sha256[:12]}...; do not fly it")
    if card.observation_size != SIZE:
        raise ConfigError(f"{path}: reads {card.observation_size} observations, the environment gives {SIZE}")
    _check_env(path, card)
    return read_actor(path, card.scenario), card


def _digest_of(path: Path) -> str:
    """SHA-256 of a file.

    Raises:
        ConfigError: it cannot be read.
    """
    try:
        return sha256(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None


def sha256(content: bytes) -> str:
    """SHA-256 of a file's content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def read_card(path: Path) -> Card:
    """Read a policy's card.

    Raises:
        ConfigError: it is missing or faulty.
    """
    return build(Card, load_json(path), str(path))


def _check_env(path: Path, card: Card) -> None:
    """Refuse a policy whose environment has changed since its training; a user's own scenario is in the card."""
    if re.fullmatch(r"\w+-v\d+", card.env) and card.env not in ENV_IDS:
        raise ConfigError(f"{path}: was trained on {card.env}, which does not exist; {nearest(card.env, ENV_IDS)}")
    if card.env not in (*ENV_IDS, *scenario_names()):
        return
    then, now = card.scenario, load_scenario(card.env)
    changed = [field.name for field in fields(now) if getattr(now, field.name) != getattr(then, field.name)]
    if changed:
        raise ConfigError(f"{path}: was trained on another {card.env}: {', '.join(changed)} changed since")
