"""The command `tune`. Optuna is imported only when it runs."""

from pathlib import Path
from typing import Annotated, NoReturn

import typer

from baselines.controllers.registry import settings_beside, slow_policies
from baselines.tuning.knobs import KNOBS, first_gains, knobs_for, present_gains
from baselines.tuning.settings_file import write_section
from baselines.tuning.study import Task, search
from formation_env.evaluation.seeds import seeds
from formation_env.settings import ConfigError, nearest
from formation_env.task.loading import config_folder, load_scenario, scenario_names


def tune(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Names or YAML files; all but the thesis's.")] = None,
    policy: Annotated[list[str] | None, typer.Option(help=f"{', '.join(KNOBS)}; may be repeated; all.")] = None,
    trials: Annotated[int, typer.Option(min=1, help="Of each policy in each scenario.")] = 200,
    episodes: Annotated[int, typer.Option(min=2, max=1_000_000, help="Tuning seeds that each trial flies.")] = 64,
    slow_trials: Annotated[int, typer.Option(min=1, help=f"Trials of {', '.join(slow_policies())}.")] = 20,
    slow_episodes: Annotated[int, typer.Option(min=2, max=1_000_000, help="Tuning seeds of theirs.")] = 8,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the settings files.",
        ),
    ] = None,
    studies: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the studies, which are gone on with.")
    ] = Path("runs/tuning"),
) -> None:
    """Search the gains of policies and write them to configs/baselines/SCENARIO.yaml.

    The same budget for all but those that solve a program at each step, whose trials take a hundred times as long.
    """
    names = scenarios or [name for name in scenario_names() if not name.startswith("thesis")]
    chosen = policy or list(KNOBS)
    try:
        flown = {each: slow_episodes if each in slow_policies() else episodes for each in chosen}
        tasks = {(name, each): task(each, name, flown[each]) for each in chosen for name in names}
        for (name, each), wanted in tasks.items():
            budget = slow_trials if each in slow_policies() else trials
            _tune_one(wanted, name, budget, out, studies / f"{Path(name).stem}_{each}.journal")
    except ConfigError as error:
        _end(f"tune: {error}", 2)
    except KeyboardInterrupt:
        _end(f"tune: interrupted; the finished trials are kept in {studies}, the same command goes on from there", 130)
    except ModuleNotFoundError as error:
        _end(f"tune: needs {str(error.name).split('.')[0]}; install it with: pip install 'formation-env[optimal]'", 1)
    except OSError as error:
        _end(f"tune: {error.filename or out or studies}: cannot be written: {error.strerror or error}", 1)


def task(policy: str, name: str, episodes: int) -> Task:
    """The search for a policy's gains in a scenario, by its name or file.

    Raises:
        ConfigError: no such scenario, or a policy without knobs.
    """
    if policy not in KNOBS:
        raise ConfigError(f"--policy: {policy!r} has no gains to search; {nearest(policy, KNOBS)}")
    scenario = load_scenario(name)
    return Task(policy, scenario, seeds("tuning", episodes), first_gains(policy), knobs_for(policy, scenario))


def _tune_one(wanted: Task, name: str, trials: int, out: Path | None, journal: Path) -> None:
    """Search, write, and tell."""
    file_name = f"{Path(name).stem}.yaml"
    path = out / file_name if out else settings_beside(name) or config_folder("baselines") / file_name
    present = present_gains(wanted.policy, path, wanted.knobs)
    with typer.progressbar(length=trials, label=f"{name} {wanted.policy}") as bar:
        found = search(wanted, trials, journal, bar.update, present)
    count, flown = len(wanted.episode_seeds), wanted.episode_seeds
    summary = f"mean cost {found.cost:.4f} m/s (trial {found.trial}; first gains {found.first_cost:.4f} m/s)"
    slow = "slow-" if wanted.policy in slow_policies() else ""
    budget = f"--{slow}trials {trials} --{slow}episodes {count}"
    command = f"python -m baselines tune {name} --policy {wanted.policy} {budget}"
    comment = f"{command}\nseeds {flown[0]} to {flown[-1]}, {summary}"
    write_section(path, wanted.policy, found.gains, comment)
    typer.echo(f"{name} {wanted.policy}: {summary}")


def _end(message: str, code: int) -> NoReturn:
    typer.echo(message, err=True)
    raise SystemExit(code)
