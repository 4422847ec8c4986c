"""Train policies, draw their learning curves, and report on them beside the classical ones."""

import contextlib
import math
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from agents.policy.library import SHIPPED
from baselines.cli import (
    PROCESSES,
    BoundEpisodes,
    Envs,
    Episodes,
    Fine,
    Out,
    Processes,
    Resume,
    SlowEpisodes,
    SweepEpisodes,
    run_report,
)
from formation_env.settings import ConfigError

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)

MISTAKE = 2
"""Exit code after a mistake of the user."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""
Bounds = Annotated[Path, typer.Option(file_okay=False, help="Folder that keeps the bounds.")]
BOUNDS = Path("reports/bounds")
"""Where the report keeps them, too."""


@contextlib.contextmanager
def _plain_errors() -> Iterator[None]:
    """A mistake of the user is one line, not a traceback."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("interrupted, nothing written", err=True)
        raise typer.Exit(INTERRUPTED) from None
    except (ConfigError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(MISTAKE) from None
    except ModuleNotFoundError as error:
        typer.echo(f"error: {error}; pip install 'formation-env[rl,report,optimal]'", err=True)
        raise typer.Exit(MISTAKE) from None


def _command() -> str:
    """The command line that runs this again."""
    return shlex.join(["python", "-m", "agents", *sys.argv[1:]])


@app.command()
def train(
    context: typer.Context,
    algorithm: Annotated[str | None, typer.Argument(help="ppo or sac.")] = None,
    env: Annotated[str | None, typer.Argument(help="A registered id, or a scenario's name or YAML file.")] = None,
    config: Annotated[Path | None, typer.Option(help="Hyperparameters; else configs/agents/ALGORITHM.yaml.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the network, the exploration and the episodes.")] = 0,
    steps: Annotated[int | None, typer.Option(min=1, help="Environment steps; else as in the file.")] = None,
    out: Annotated[Path | None, typer.Option(help="New folder of the run; else runs/ALGORITHM_ENV_seedN.")] = None,
    start: Annotated[
        Path | None, typer.Option(help="Actor (.safetensors), or run, whose pretrained actor to start from.")
    ] = None,
    resume: Annotated[Path | None, typer.Option(help="Folder of a run to go on with; all else is as it was.")] = None,
    time_limit: Annotated[float, typer.Option(min=0, help="Minutes after which to save and stop.")] = math.inf,
    rows: Annotated[int | None, typer.Option(min=1, help="Environments side by side; else as in the file.")] = None,
    validations: Annotated[int, typer.Option(min=1, help="Validations over the run.")] = 20,
    validation_episodes: Annotated[int, typer.Option(min=2, help="Episodes of each validation.")] = 64,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch; more help on an idle machine only.")] = 1,
) -> None:
    """Train a policy; keep the best on the validation seeds. Ctrl-C saves and ends; --resume FOLDER goes on."""
    with _plain_errors():
        from agents.training.run_settings import default_folder, plan_run
        from agents.training.train import resume as resume_run
        from agents.training.train import train as train_run

        if resume is not None:
            _check_alone(context, resume)
            _tell_end(resume_run(resume, 60 * time_limit), resume)
            return
        if algorithm is None or env is None:
            raise ConfigError("train: give an algorithm and an environment, or --resume FOLDER")
        run = plan_run(
            algorithm,
            env,
            steps=steps,
            seed=seed,
            rows=rows,
            config=config,
            validations=validations,
            validation_episodes=validation_episodes,
            threads=threads,
            start=start,
            command=_command(),
        )
        folder = out or default_folder(run)
        _tell_end(train_run(run, folder, 60 * time_limit), folder)


def _check_alone(context: typer.Context, folder: Path) -> None:
    """Refuse what is given beside --resume and would make it another run."""
    from agents.training.run_folder import load_run

    run = load_run(folder)
    for name, given in context.params.items():
        source = context.get_parameter_source(name)
        if name in ("resume", "time_limit") or source is None or source.name == "DEFAULT":
            continue
        if name not in ("algorithm", "env") or given != getattr(run, name):
            raise ConfigError(f"--resume: {folder} goes on as it began: {run.algorithm} {run.env}; leave out {name}")


def _tell_end(outcome: str, folder: Path) -> None:
    """Say how a training ended, and what is to be done then."""
    if outcome == "finished":
        typer.echo(f"the best policy is {folder / 'best.safetensors'}, its learning curve {folder / 'validation.csv'}")
        return
    typer.echo(f"{outcome}; go on with: python -m agents train --resume {shlex.quote(str(folder))}", err=True)
    if outcome == "interrupted":
        raise typer.Exit(INTERRUPTED)


@app.command()
def tune(
    algorithm: Annotated[str, typer.Argument(help="ppo or sac.")],
    env: Annotated[str, typer.Argument(help="A registered id, or a scenario's name or YAML file.")],
    trials: Annotated[int, typer.Option(min=1, help="Trainings, the first with the hyperparameters of the file.")] = 20,
    steps: Annotated[int | None, typer.Option(min=1, help="Environment steps of each; else as in the file.")] = None,
    config: Annotated[Path | None, typer.Option(help="Hyperparameters; else configs/agents/ALGORITHM.yaml.")] = None,
    study: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder to go on with; else runs/tuning/ALGORITHM_ENV.")
    ] = None,
    start: Annotated[Path | None, typer.Option(help="As of train, for all; else they are pretrained once.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="As of train.")] = 0,
    rows: Annotated[int | None, typer.Option(min=1, help="Environments side by side; else as in the file.")] = None,
    validations: Annotated[int, typer.Option(min=1, help="Of each trial; there it may be given up.")] = 8,
    validation_episodes: Annotated[int, typer.Option(min=2, help="Episodes of each validation.")] = 64,
) -> None:
    """Search hyperparameters by the validation cost; the best are STUDY/best.yaml, for --config of train."""
    with _plain_errors():
        from agents.training.run_settings import default_folder, plan_run
        from agents.tuning.search import BEST, search

        run = plan_run(
            algorithm,
            env,
            steps=steps,
            seed=seed,
            rows=rows,
            config=config,
            validations=validations,
            validation_episodes=validation_episodes,
            start=start,
            command=_command(),
        )
        folder = study or Path("runs/tuning") / default_folder(run).name.rpartition("_")[0]
        try:
            found = search(run, trials, folder, lambda found: typer.echo(found.in_words()))
        except KeyboardInterrupt:
            typer.echo(f"interrupted; finished trials are kept in {folder}, the same command goes on", err=True)
            raise typer.Exit(INTERRUPTED) from None
        typer.echo(f"{found.in_words()}; the hyperparameters are {folder / BEST}")


@app.command()
def bench(
    env: Annotated[str, typer.Argument(help="A registered id, or a scenario.")] = "FormationKeeping-v0",
    threads: Annotated[list[int], typer.Option(min=1, help="Threads of torch.")] = [1, 2],  # noqa: B006
    rounds: Annotated[int, typer.Option(min=1, help="Rollouts with their updates; the fastest counts.")] = 5,
) -> None:
    """Print how fast PPO learns with its default settings, and the environment's share of that time."""
    with _plain_errors():
        from agents.results.bench import table

        typer.echo(f"PPO on {env}\n{table(env, threads, rounds)}")


@app.command()
def curve(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs, of any algorithms, environments and seeds.")],
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the pictures, learning_ENVIRONMENT.png.")],
    baseline: Annotated[list[str], typer.Option(help="Classical policies drawn as levels.")] = ["lqr", "lqr_nominal"],  # noqa: B006
    bounds: Bounds = BOUNDS,
) -> None:
    """Draw learning curves, a picture per environment; classical policies fly the same validation seeds as levels."""
    with _plain_errors():
        from agents.results.curve import draw

        for picture in draw(runs, out, baseline, bounds):
            typer.echo(picture)


@app.command()
def export(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs that differ in their training seeds.")],
    out: Annotated[Path, typer.Option(help="Folder of the policy's files.")] = SHIPPED,
) -> None:
    """Write the policy that is best on validation seeds: tensors, a card with all runs' test results, an ONNX graph."""
    with _plain_errors():
        from agents.results.export import export as export_runs

        typer.echo(export_runs(runs, out))


@app.command()
def evaluate(
    source: Annotated[Path, typer.Argument(help="A .safetensors file, a run's folder, or your own SB3 model (.zip).")],
    env: Annotated[str | None, typer.Option(help="Where to fly; else where it was trained.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Test seeds.")] = 100,
    bound_episodes: Annotated[int, typer.Option(min=0, help="Of these, seeds held against the bound; 0 is none.")] = 20,
    bounds: Bounds = BOUNDS,
    allow_pickle: Annotated[bool, typer.Option("--allow-pickle", help="Load a .zip, which may run any code.")] = False,
    throttle_power: Annotated[
        float | None, typer.Option(min=0.01, help="p, if a .zip's actions z mean sign(z)|z|^p; else they are thrusts.")
    ] = None,
) -> None:
    """Fly a policy on the test seeds: mean and 95 % interval of each metric, and cost over the bound."""
    with _plain_errors():
        from agents.results.evaluate import choose, score

        if allow_pickle and source.suffix == ".zip":
            typer.echo(f"warning: {source}: what it holds pickled is being run", err=True)
        policy, scenario = choose(source, env, allow_pickle, throttle_power)
        if getattr(policy, "scenario", scenario) != scenario:
            typer.echo(f"note: {source} was trained on another scenario than {env}", err=True)
        typer.echo(score(policy, scenario, episodes, bound_episodes, bounds).to_string(float_format="{:.4g}".format))


@app.command()
def report(
    model: Annotated[list[str] | None, typer.Option(help="LABEL=PATH, as of evaluate; else the shipped ones.")] = None,
    env: Envs = None,
    episodes: Episodes = 100,
    slow_episodes: SlowEpisodes = 5,
    sweep_episodes: SweepEpisodes = 10,
    bound_episodes: BoundEpisodes = 2,
    fine: Fine = False,
    resume: Resume = False,
    out: Out = Path("reports"),
    processes: Processes = PROCESSES,
) -> None:
    """Fly learned and classical policies on the same test seeds: tables, fronts and robustness on one HTML page."""

    def write() -> Path:
        from agents.results.report import report_models
        from baselines.report import ReportOptions

        options = ReportOptions(
            episodes=episodes,
            slow_episodes=slow_episodes,
            sweep_episodes=sweep_episodes,
            sweep_bound_episodes=bound_episodes,
            coarse=not fine,
            resume=resume,
        )
        return report_models(model or [], env, options, out, _command(), processes)

    run_report("report", out, write)


if __name__ == "__main__":
    app()
