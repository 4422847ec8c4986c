"""The commands of `formation-env agents`. What they need is imported when they run."""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import typer

from agents.cli_results import AllowPickle, ThrottlePower, add_result_commands, warn_of_pickle
from baselines.cli_report import ReportArguments, write_report_page
from formation_env.cli_errors import DISTRIBUTION, INTERRUPTED, on_interrupt
from formation_env.cli_group import Group, add_command, command_line, make_app
from formation_env.cli_options import MAX_EPISODES, Env, Seed
from formation_env.files import check_writable

NAME = "agents"
PROGRAM = f"{DISTRIBUTION} {NAME}"

Algorithm = Annotated[str, typer.Argument(help="Algorithm: ppo or sac.", show_default=False)]
Config = Annotated[Path | None, typer.Option(help="YAML file of hyperparameters.", show_default="configs/agents")]
Steps = Annotated[int | None, typer.Option(min=1, help="Environment steps.", show_default="from --config")]
Rows = Annotated[int | None, typer.Option(min=1, help="Parallel environments.", show_default="from --config")]
Start = Annotated[
    Path | None,
    typer.Option(help="Pretrained actor to start from: a .safetensors file, or a run's folder."),
]
ValidationEpisodes = Annotated[int, typer.Option(min=2, max=MAX_EPISODES, help="Episodes of each validation.")]


class AgentsGroup(Group):
    """The group `agents`."""

    renamed: ClassVar = {"curve": f"{PROGRAM} plot-curves"}
    renamed_options: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "evaluate": {"--env": f"an argument, {PROGRAM} evaluate SOURCE ENV"},
        "report": {"--env": f"an argument, {PROGRAM} report ENV..."},
        "tune": {"--study": "--out"},
        "plot-curves": {"--baseline": "--policy"},
    }


app = make_app("Reinforcement learning: train policies, plot their curves, evaluate and report on them.", AgentsGroup)


@app.command(
    epilog=f"Example: {PROGRAM} train ppo FormationKeeping-v0 --out runs/mine; continue: --out runs/mine --resume"
)
def train(  # longer than 40 lines: each option has its line
    context: typer.Context,
    algorithm: Annotated[str | None, typer.Argument(help="Algorithm: ppo or sac.", show_default=False)] = None,
    env: Annotated[
        str | None, typer.Argument(help="Registered id, scenario name or YAML file.", show_default=False)
    ] = None,
    config: Config = None,
    seed: Seed = 0,
    steps: Steps = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the run.", show_default="runs/ALGORITHM_ENV_seedN")
    ] = None,
    start: Start = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the run in --out with its own settings.")] = False,
    time_limit: Annotated[float, typer.Option(min=0, help="Minutes after which to save and stop.")] = math.inf,
    rows: Rows = None,
    validations: Annotated[int, typer.Option(min=1, help="Number of validations during the run.")] = 20,
    validation_episodes: ValidationEpisodes = 64,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch; more than 1 helps on idle machines only.")] = 1,
) -> None:
    """Train a policy and keep the best by validation cost. Ctrl-C saves and ends; --resume continues."""
    from formation_env.settings import ConfigError

    if resume:
        if out is None:
            named = algorithm if algorithm and Path(algorithm).exists() else "FOLDER"
            raise ConfigError(f"train --resume: now a flag, {PROGRAM} train --out {shlex.quote(named)} --resume")
        _resume(context, out, 60 * time_limit)
        return
    if algorithm is None or env is None:
        raise ConfigError("train: give an algorithm and an environment, or --out FOLDER --resume")
    from agents.training.run_settings import default_folder, plan_run
    from agents.training.train import train as train_run

    run = plan_run(
        algorithm=algorithm,
        env=env,
        steps=steps,
        seed=seed,
        rows=rows,
        config=config,
        validations=validations,
        validation_episodes=validation_episodes,
        threads=threads,
        start=_existing(start),
        command=command_line(NAME),
    )
    folder = out or default_folder(run)
    check_writable(folder)
    _report_outcome(train_run(run, folder, 60 * time_limit), folder)


def _existing(start: Path | None) -> Path | None:
    """The path itself.

    Raises:
        ConfigError: nothing is there.
    """
    from formation_env.settings import ConfigError

    if start is not None and not start.exists():
        raise ConfigError(f"--start: {start}: no such file or folder")
    return start


def _resume(context: typer.Context, folder: Path, time_limit_s: float) -> None:
    """Continue a run; arguments that would make it another run are refused.

    Raises:
        ConfigError: no run is there, or an argument differs from the run's.
    """
    from agents.training.run_folder import load_run
    from agents.training.train import resume
    from formation_env.settings import ConfigError

    run = load_run(folder)
    for name, value in context.params.items():
        source = context.get_parameter_source(name)
        if name in ("resume", "time_limit", "out") or source is None or source.name == "DEFAULT":
            continue
        if name not in ("algorithm", "env") or value != getattr(run, name):
            raise ConfigError(f"--resume: {folder} continues as it began: {run.algorithm} {run.env}; leave out {name}")
    _report_outcome(resume(folder, time_limit_s), folder)


def _report_outcome(outcome: str, folder: Path) -> None:
    """Print how a training ended and how to continue."""
    if outcome == "finished":
        typer.echo(f"the best policy is {folder / 'best.safetensors'}, its learning curve {folder / 'validation.csv'}")
        return
    typer.echo(f"{outcome}; continue with: {PROGRAM} train --out {shlex.quote(str(folder))} --resume", err=True)
    if outcome == "interrupted":
        raise typer.Exit(INTERRUPTED)


@app.command(epilog=f"Example: {PROGRAM} tune sac FormationKeeping-v0 --trials 30 --steps 60000")
def tune(
    algorithm: Algorithm,
    env: Env,
    trials: Annotated[int, typer.Option(min=1, help="Trainings; the first has the hyperparameters of the file.")] = 20,
    steps: Steps = None,
    config: Config = None,
    out: Annotated[
        Path | None,
        typer.Option(file_okay=False, help="Folder of the study; a present one continues.", show_default="runs/tuning"),
    ] = None,
    start: Start = None,
    seed: Seed = 0,
    rows: Rows = None,
    validations: Annotated[int, typer.Option(min=1, help="Validations of each trial; poor trials stop there.")] = 8,
    validation_episodes: ValidationEpisodes = 64,
) -> None:
    """Search hyperparameters by validation cost; OUT/best.yaml is a file for train --config."""
    from agents.training.run_settings import default_folder, plan_run
    from agents.tuning.search import BEST, search

    run = plan_run(
        algorithm=algorithm,
        env=env,
        steps=steps,
        seed=seed,
        rows=rows,
        config=config,
        validations=validations,
        validation_episodes=validation_episodes,
        start=_existing(start),
        command=command_line(NAME),
    )
    folder = out or Path("runs/tuning") / default_folder(run).name.rpartition("_")[0]
    check_writable(folder)
    with on_interrupt(f"interrupted; finished trials are saved in {folder}, the same command continues"):
        found = search(run, trials, folder, lambda found: typer.echo(found.in_words()))
    typer.echo(f"{found.in_words()}; the hyperparameters are {folder / BEST}")


@dataclass(frozen=True, kw_only=True)
class LearnedReportArguments(ReportArguments):
    """Fly learned and classical policies on the same test episodes, and write tables and an HTML page."""

    model: Annotated[
        list[str] | None,
        typer.Option(help="LABEL=PATH of a learned policy; may be repeated", show_default="the shipped policies"),
    ] = None
    allow_pickle: AllowPickle = False
    throttle_power: ThrottlePower = None


def report(arguments: LearnedReportArguments) -> None:
    """Write the report of learned and classical policies."""

    def write() -> Path:
        from agents.results.report import report_models

        models = arguments.model or []
        for model in models if arguments.allow_pickle else ():
            if model.endswith(".zip"):
                warn_of_pickle(model)
        return report_models(
            models,
            arguments.envs,
            arguments.options(),
            arguments.out,
            command_line(NAME),
            arguments.processes,
            arguments.policy or (),
            allow_pickle=arguments.allow_pickle,
            throttle_power=arguments.throttle_power,
        )

    write_report_page(arguments.out, arguments.resume, write)


add_command(
    app, "report", LearnedReportArguments, report, f"{PROGRAM} report keeping --model mine=runs/mine --episodes 20"
)
add_result_commands(app)
