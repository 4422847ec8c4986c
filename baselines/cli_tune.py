"""The command `tune`. What it needs is imported when it runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formation_env.cli_errors import DISTRIBUTION, on_interrupt
from formation_env.cli_options import MAX_EPISODES, Envs
from formation_env.files import check_writable, is_checkout

if TYPE_CHECKING:
    from baselines.tuning.study import TuningTask

EXAMPLE = f"{DISTRIBUTION} baselines tune mine.yaml --policy smc --trials 20 --episodes 16"

Policies = Annotated[
    list[str] | None,
    typer.Option("--policy", help="Name of a policy; may be repeated.", show_default="all tunable"),
]
Trials = Annotated[int, typer.Option(min=1, help="Trials of each policy in each scenario.")]
Episodes = Annotated[int, typer.Option(min=2, max=MAX_EPISODES, help="Tuning episodes of each trial.")]
SlowTrials = Annotated[int, typer.Option(min=1, help="Trials of slow policies (mpc).")]
SlowEpisodes = Annotated[int, typer.Option(min=2, max=MAX_EPISODES, help="Tuning episodes of slow policies (mpc).")]
SettingsFolder = Annotated[
    Path | None,
    typer.Option(
        file_okay=False,
        help="Folder of the settings files.",
        show_default="beside a YAML file, as NAME.baselines.yaml; configs/baselines for shipped scenarios",
    ),
]
Studies = Annotated[Path, typer.Option(file_okay=False, help="Optuna journal folder; existing studies continue.")]


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Size of the searches.

    Attributes:
        trials: of each policy in each scenario.
        episodes: of each trial.
        slow_trials: trials of slow policies.
        slow_episodes: episodes of their trials.
    """

    trials: int
    episodes: int
    slow_trials: int
    slow_episodes: int

    def of(self, policy: str) -> tuple[int, int]:
        """Trials and episodes of a policy."""
        slow = _is_slow(policy)
        return (self.slow_trials, self.slow_episodes) if slow else (self.trials, self.episodes)

    def options(self, policy: str) -> str:
        """The options that give a policy its budget."""
        slow = "slow-" if _is_slow(policy) else ""
        trials, episodes = self.of(policy)
        return f"--{slow}trials {trials} --{slow}episodes {episodes}"


def tune(
    envs: Envs = None,
    policy: Policies = None,
    trials: Trials = 200,
    episodes: Episodes = 64,
    slow_trials: SlowTrials = 20,
    slow_episodes: SlowEpisodes = 8,
    out: SettingsFolder = None,
    studies: Studies = Path("runs/tuning"),
) -> None:
    """Search the settings of policies by cost on the tuning episodes.

    Without ENVS all shipped scenarios but the thesis's are tuned. All policies get the same budget, except those that
    solve a program at each step, whose trials take a hundred times as long.
    """
    from baselines.tuning.search_space import SEARCH_SPACES
    from formation_env.task.loading import scenario_names

    names = envs or [name for name in scenario_names() if not name.startswith("thesis")]
    budget = Budget(trials=trials, episodes=episodes, slow_trials=slow_trials, slow_episodes=slow_episodes)
    files = {name: settings_file(name, out) for name in names}
    tasks = {
        (name, each): make_task(each, name, budget.of(each)[1]) for each in policy or SEARCH_SPACES for name in names
    }
    for folder in {studies, *(path.parent for path in files.values())}:
        check_writable(folder)
    with on_interrupt(f"interrupted; finished trials are saved in {studies}, the same command continues"):
        for (name, _), task in tasks.items():
            _tune_one(task, name, budget, files[name], studies)


def settings_file(name: str, out: Path | None) -> Path:
    """Path of the settings file of an environment.

    Args:
        name: registered id, scenario name or YAML file.
        out: folder that the user asked for.

    Raises:
        ConfigError: a shipped scenario of an installed package, and no folder is given.
    """
    from baselines.controllers.registry import settings_beside
    from formation_env.settings import ConfigError
    from formation_env.task.loading import ENV_IDS, config_folder

    path, shipped = Path(name), ENV_IDS.get(name, name)
    is_file = path.suffix in (".yaml", ".yml")
    if out is not None:
        return out / f"{path.stem if is_file else shipped}.yaml"
    if (beside := settings_beside(name)) is not None:
        return beside
    if not is_checkout():
        raise ConfigError(f"tune: {name}: its settings belong to the installed package; give --out FOLDER")
    return config_folder("baselines") / f"{path.stem if is_file else shipped}.yaml"


def make_task(policy: str, env: str, episodes: int) -> "TuningTask":
    """The search for a policy's settings in an environment.

    Raises:
        ConfigError: no such environment, or a policy without a search space.
    """
    from baselines.tuning.search_space import SEARCH_SPACES, default_settings, search_space
    from baselines.tuning.study import TuningTask
    from formation_env.evaluation.seeds import seeds
    from formation_env.settings import ConfigError, nearest
    from formation_env.task.loading import load_scenario

    if policy not in SEARCH_SPACES:
        raise ConfigError(f"--policy: {policy!r} has no settings to search; {nearest(policy, SEARCH_SPACES)}")
    scenario = load_scenario(env)
    return TuningTask(
        policy=policy,
        scenario=scenario,
        episode_seeds=seeds("tuning", episodes),
        settings=default_settings(policy),
        parameters=search_space(policy, scenario),
    )


def _tune_one(task: "TuningTask", name: str, budget: Budget, path: Path, studies: Path) -> None:
    """Search one policy's settings in one environment, write them, and print the result."""
    from baselines.tuning.search_space import values_in_use
    from baselines.tuning.settings_file import write_section
    from baselines.tuning.study import search

    trials, policy = budget.of(task.policy)[0], task.policy
    in_use = values_in_use(policy, path, task.parameters)
    journal = studies / f"{Path(name).stem}_{policy}.journal"
    with typer.progressbar(length=trials, label=f"{name} {policy}") as bar:
        result = search(task, trials, journal, bar.update, in_use)
    costs = f"mean cost {result.cost:.4f} m/s (trial {result.trial}; default settings {result.first_cost:.4f} m/s)"
    command = f"{DISTRIBUTION} baselines tune {name} --policy {policy} {budget.options(policy)}"
    comment = f"{command}\n{_range(task.episode_seeds)}, {costs}"
    write_section(path, policy, result.settings, comment)
    typer.echo(f"{name} {policy}: {costs}; written to {path}")


def _range(seeds: Sequence[int]) -> str:
    return f"seeds {seeds[0]} to {seeds[-1]}"


def _is_slow(policy: str) -> bool:
    from baselines.controllers.registry import slow_policies

    return policy in slow_policies()
