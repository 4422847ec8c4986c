"""Learned policies in the classical policies' report."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from agents.policy.actor import Actor, to_bytes
from agents.policy.library import CARD, TENSORS, Card, read_card, sha256, shipped_paths
from agents.results.evaluate import open_model, open_policy
from agents.results.report_table import learned_table
from baselines.controllers.registry import POLICIES
from baselines.experiments.policy_factories import PolicyFactory, classical
from baselines.experiments.statistics import Results
from baselines.report import ReportOptions, Table, write_report
from baselines.report.swarm_table import swarm_tables
from formation_env.evaluation.rollout import Policy
from formation_env.settings import ConfigError
from formation_env.task.loading import ENV_IDS, load_scenario, scenario_names
from formation_env.task.scenario import Scenario


@dataclass(frozen=True)
class Learned:
    """A factory of learned policies: it gives the one that was trained on exactly the scenario, or none.

    Attributes:
        label: their name in the report.
        sources: what `open_policy` takes.

    Raises:
        ConfigError: a faulty policy, or two that were trained on the same scenario.
    """

    label: str
    sources: tuple[Path, ...]

    def __post_init__(self) -> None:
        scenarios = [_open(source).scenario for source in self.sources]
        for index, scenario in enumerate(scenarios):
            if scenario in scenarios[:index]:
                raise ConfigError(f"--model: {self.label}: {self.sources[index]} was trained on what another was, too")

    def __call__(self, original: Scenario, design: Scenario) -> Actor | None:
        """The policy for a scenario.

        Args:
            original: what it must have been trained on.
            design: unused; the policy sees the observation alone.
        """
        return next((actor for actor in map(_open, self.sources) if actor.scenario == original), None)

    def settings(self, original: Scenario) -> dict[str, Any] | None:
        """Identity of its policy for a scenario as plain data; None if it has none."""
        actor = self(original, original)
        if actor is None:
            return None
        widths = [len(bias) for _, bias in actor.layers]
        return {"layers": widths, "sha256": sha256(to_bytes(actor))} | asdict(actor.functions)


@lru_cache
def _open(source: Path) -> Actor:
    """A policy, read once."""
    return open_policy(source)


@dataclass(frozen=True)
class UserModel:
    """A factory of a user's own SB3 model, which flies on every environment that is named.

    Attributes:
        path: of the .zip file.
        throttle_power: see `agents.results.evaluate.Sb3Policy`.

    Raises:
        ConfigError: it is no such model, or made for other environments.
    """

    path: Path
    throttle_power: float | None = None

    def __post_init__(self) -> None:
        _open_zip(self.path, self.throttle_power)

    def __call__(self, original: Scenario, design: Scenario) -> Policy:
        """The policy; the scenario makes no difference: it sees the observation alone."""
        return _open_zip(self.path, self.throttle_power)

    def settings(self, original: Scenario) -> dict[str, Any]:
        """The file's hash, which tells the model from others."""
        return {"sha256": sha256(self.path.read_bytes()), "throttle_power": self.throttle_power}


@lru_cache
def _open_zip(path: Path, throttle_power: float | None) -> Policy:
    """A user's model, loaded once; only made once its pickles are allowed, see `report_models`."""
    return open_model(path, allow_pickle=True, throttle_power=throttle_power)


def report_models(
    models: Sequence[str],
    envs: Sequence[str] | None,
    options: ReportOptions,
    out: Path,
    command: str,
    workers: int = 1,
    policies: Sequence[str] = (),
    *,
    allow_pickle: bool = False,
    throttle_power: float | None = None,
) -> Path:
    """Write the report with the classical policies and learned ones.

    Args:
        models: each LABEL=PATH; policies of several scenarios may share a label. Without any, the shipped policies,
            labelled by their algorithms.
        envs: registered ids, or names or paths of scenarios; by default those of the models, or the registered ones
            and those of the shipped policies. A user's SB3 model needs them.
        options: effort.
        out: folder of the report.
        command: the command line, recorded in the report.
        workers: processes.
        policies: names of the classical policies; by default all.
        allow_pickle: permission to load SB3 models (.zip): their pickled objects can run any code.
        throttle_power: of SB3 models, see `agents.results.evaluate.Sb3Policy`.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty model or environment, or a model that flies nowhere; one line.
        OSError: the folder cannot be written.
    """
    sources = parse_models(models) if models else shipped_by_algorithm()
    zips = _take_zips(sources)
    learned = {label: Learned(label, tuple(paths)) for label, paths in sources.items()}
    if zips and not envs:
        raise ConfigError(f"--model: {next(iter(zips.values()))} does not name its environment; give one or more")
    flown = list(envs or dict.fromkeys((*(() if models else ENV_IDS), *envs_of(learned))))
    if models:
        _check_flown(learned, flown)
    for path in zips.values():
        open_model(path, allow_pickle, throttle_power)
    own = {label: UserModel(path, throttle_power) for label, path in zips.items()}
    cards = {label: _cards(paths) for label, paths in sources.items()}

    def tables(results: Sequence[Results]) -> list[Table]:
        learned = [learned_table(results, cards)] if any(cards.values()) else []
        return learned if envs or models else [*learned, *swarm_tables(options.episodes)(results)]

    factories: dict[str, PolicyFactory] = {**classical(policies, flown), **learned, **own}
    return write_report(factories, flown, options, out, command, workers, tables)


def _take_zips(sources: dict[str, list[Path]]) -> dict[str, Path]:
    """Take the labels of SB3 models out of the sources.

    Raises:
        ConfigError: such a label has several files: nobody could say which of them flew.
    """
    labels = [label for label, paths in sources.items() if any(path.suffix == ".zip" for path in paths)]
    for label in labels:
        if len(sources[label]) > 1:
            raise ConfigError(f"--model: {label}: an SB3 model (.zip) needs a label of its own")
    return {label: sources.pop(label)[0] for label in labels}


def _cards(paths: Sequence[Path]) -> list[Card]:
    """Cards of the policies that have one; folders of runs have none."""
    return [read_card(path.with_suffix(CARD)) for path in paths if path.suffix == TENSORS]


def parse_models(models: Sequence[str]) -> dict[str, list[Path]]:
    """Paths by label.

    Raises:
        ConfigError: an item is not LABEL=PATH, or takes a classical policy's name.
    """
    paths: dict[str, list[Path]] = {}
    for item in models:
        label, equals, path = item.partition("=")
        if not (label and equals and path):
            raise ConfigError(f"--model: must be LABEL=PATH, got {item!r}")
        if label in POLICIES:
            raise ConfigError(f"--model: {label!r} is the name of a classical policy; choose another label")
        paths.setdefault(label, []).append(Path(path))
    return paths


def shipped_by_algorithm() -> dict[str, list[Path]]:
    """The shipped policies by their algorithms."""
    paths: dict[str, list[Path]] = {}
    for path in shipped_paths():
        paths.setdefault(read_card(path.with_suffix(CARD)).algorithm, []).append(path)
    return paths


def envs_of(learned: Mapping[str, Learned]) -> list[str]:
    """Ids, or else names, of the scenarios that policies were trained on.

    Raises:
        ConfigError: one of them has none.
    """
    names = {load_scenario(env): env for env in (*scenario_names(), *ENV_IDS)}
    found: dict[str, None] = {}
    for source in (source for factory in learned.values() for source in factory.sources):
        scenario = _open(source).scenario
        if scenario not in names:
            raise ConfigError(f"ENV: {source} was trained on a scenario of its own; name its file")
        found[names[scenario]] = None
    return list(found)


def _check_flown(learned: Mapping[str, Learned], envs: Sequence[str]) -> None:
    """Refuse a model that flies in none of the environments."""
    scenarios = [load_scenario(env) for env in envs]
    for label, factory in learned.items():
        for source in factory.sources:
            if _open(source).scenario not in scenarios:
                raise ConfigError(f"--model: {label}: {source} was trained on what the report leaves out")
