"""Learned policies in the classical policies' report."""

from collections.abc import Sequence
from pathlib import Path

from agents.runs import LearnedPolicy, load_policy, load_run
from baselines.factories import Classical, PolicyFactory
from baselines.registry import POLICIES
from baselines.report import Wanted, write_report
from formation_env.evaluation import scenario_of
from formation_env.scenario import Scenario
from formation_env.settings import ConfigError


def report_models(models: Sequence[str], envs: Sequence[str] | None, episodes: int, out: Path, command: str) -> Path:
    """Write the report with all classical policies and some trained ones.

    Args:
        models: each LABEL=FOLDER; runs on several scenarios may share a label.
        envs: registered ids, or names or paths of scenarios; by default those of the runs.
        episodes: test episodes per environment.
        out: folder of the report.
        command: the command line, to be noted.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty model or environment; one line.
        OSError: the folder cannot be written.
    """
    folders = parse_models(models)
    if not envs:
        envs = list(dict.fromkeys(load_run(folder).env for runs in folders.values() for folder in runs))
    policies: dict[str, PolicyFactory] = {name: Classical(name) for name in POLICIES}
    for label, runs in folders.items():
        policies[label] = learned(label, [load_policy(folder) for folder in runs])
    _check_trained(folders, envs)
    return write_report(policies, envs, Wanted(episodes, sweep_episodes=0), out, command)


def parse_models(models: Sequence[str]) -> dict[str, list[Path]]:
    """Folders by label.

    Raises:
        ConfigError: an item is not LABEL=FOLDER, or takes a classical policy's name.
    """
    folders: dict[str, list[Path]] = {}
    for item in models:
        label, equals, folder = item.partition("=")
        if not (label and equals and folder):
            raise ConfigError(f"--model: must be LABEL=FOLDER, got {item!r}")
        if label in POLICIES:
            raise ConfigError(f"--model: {label!r} is the name of a classical policy; choose another label")
        folders.setdefault(label, []).append(Path(folder))
    return folders


def learned(label: str, policies: Sequence[LearnedPolicy]) -> PolicyFactory:
    """A factory that gives the policy trained on exactly the scenario, or none.

    Raises:
        ConfigError: two were trained on the same.
    """
    for index, policy in enumerate(policies):
        if any(policy.scenario == other.scenario for other in policies[:index]):
            raise ConfigError(f"--model: {label}: two runs were trained on the same scenario")

    def factory(original: Scenario, believed: Scenario) -> LearnedPolicy | None:
        return next((policy for policy in policies if policy.scenario == original), None)

    return factory


def _check_trained(folders: dict[str, list[Path]], envs: Sequence[str]) -> None:
    """Refuse a model that flies in none of the environments."""
    scenarios = [scenario_of(env) for env in envs]
    for label, runs in folders.items():
        for folder in runs:
            run = load_run(folder)
            if run.scenario not in scenarios:
                raise ConfigError(f"--model: {label}: {folder} was trained on {run.env}, which the report leaves out")
