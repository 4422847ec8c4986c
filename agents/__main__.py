"""Train policies, draw their learning curves, and report on them beside the classical ones."""

import contextlib
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from agents.shipped import SHIPPED
from formation_env.settings import ConfigError

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)

MISTAKE = 2
"""Exit code after a mistake of the user."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


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
        typer.echo(f"error: {error}; pip install 'formation-env[rl,report]'", err=True)
        raise typer.Exit(MISTAKE) from None


def _command() -> str:
    """The command line that runs this again."""
    return shlex.join(["python", "-m", "agents", *sys.argv[1:]])


@app.command()
def train(
    algorithm: Annotated[str, typer.Argument(help="ppo or sac.")],
    env: Annotated[str, typer.Argument(help="A registered id, or a scenario's name or YAML file.")],
    steps: Annotated[int, typer.Option(min=1, help="Environment steps to train for.")],
    out: Annotated[Path, typer.Option(help="Folder of the run; must not hold one yet.")],
    seed: Annotated[int, typer.Option(min=0, help="Of the network, the exploration and the episodes.")] = 0,
    rows: Annotated[int | None, typer.Option(min=1, help="Environments side by side; else as in the file.")] = None,
    config: Annotated[Path | None, typer.Option(help="Hyperparameters; else configs/agents/ALGORITHM.yaml.")] = None,
    validations: Annotated[int, typer.Option(min=1, help="Validations over the run.")] = 20,
    validation_episodes: Annotated[int, typer.Option(min=2, help="Episodes of each validation.")] = 64,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch; more help only on an idle machine.")] = 1,
) -> None:
    """Train a policy; keep the best on the validation seeds. Ctrl-C saves and ends."""
    with _plain_errors():
        from agents.plan import plan_run
        from agents.train import train as train_run

        run = plan_run(algorithm, env, steps, seed, rows, config, validations, validation_episodes, threads, _command())
        if not train_run(run, out):
            typer.echo(f"interrupted; what was learnt up to now is in {out}", err=True)
            raise typer.Exit(INTERRUPTED)
        typer.echo(f"the best model is {out / 'model.zip'}, its learning curve {out / 'validation.csv'}")


@app.command()
def curve(
    folder: Annotated[Path, typer.Argument(help="Folder of a run.")],
    out: Annotated[Path, typer.Option(help="The picture, PNG, SVG or PDF.")],
    baseline: Annotated[list[str], typer.Option(help="Classical policies drawn as levels.")] = ["zero", "lqr"],  # noqa: B006
) -> None:
    """Draw a run's learning curve, with classical policies flown on the same validation seeds as levels."""
    with _plain_errors():
        from agents.curve import draw

        draw(folder, out, baseline)
        typer.echo(out)


@app.command()
def export(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs that differ in their training seeds.")],
    out: Annotated[Path, typer.Option(help="Folder of the policy's files.")] = SHIPPED,
) -> None:
    """Write the policy that is best on validation seeds: tensors, a card with all runs' test results, an ONNX graph."""
    with _plain_errors():
        from agents.export import export as export_runs

        typer.echo(export_runs(runs, out))


@app.command()
def evaluate(
    source: Annotated[Path, typer.Argument(help="A .safetensors file, a run's folder, or your own SB3 model (.zip).")],
    env: Annotated[str | None, typer.Option(help="Where to fly; else where it was trained.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Test seeds.")] = 100,
    bound_episodes: Annotated[int, typer.Option(min=0, help="Of these, seeds held against the bound; 0 is none.")] = 20,
    bounds: Annotated[Path, typer.Option(help="Folder that keeps the bounds.")] = Path("reports/bounds"),
    allow_pickle: Annotated[bool, typer.Option("--allow-pickle", help="Load a .zip, which may run any code.")] = False,
    throttle_power: Annotated[float | None, typer.Option(help="p, if a .zip's actions z mean sign(z)|z|^p.")] = None,
) -> None:
    """Fly a policy on the test seeds: mean and 95 % interval of each metric, and cost over the bound."""
    with _plain_errors():
        from agents.evaluate import choose, score

        if allow_pickle and source.suffix == ".zip":
            typer.echo(f"warning: {source}: what it holds pickled is being run", err=True)
        policy, scenario = choose(source, env, allow_pickle, throttle_power)
        typer.echo(score(policy, scenario, episodes, bound_episodes, bounds).to_string(float_format="{:.4g}".format))


@app.command()
def report(
    model: Annotated[list[str] | None, typer.Option(help="LABEL=PATH, as of evaluate; else the shipped ones.")] = None,
    env: Annotated[list[str] | None, typer.Option(help="Environments; else those of the models.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Test episodes per environment.")] = 100,
    out: Annotated[Path, typer.Option(help="Folder of the report.")] = Path("reports"),
) -> None:
    """Fly learned and classical policies on the same test seeds: tables and one HTML page."""
    with _plain_errors():
        from agents.report import report_models

        typer.echo(report_models(model or [], env, episodes, out, _command()))


if __name__ == "__main__":
    app()
