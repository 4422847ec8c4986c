"""The commands about trained policies: evaluate, export, renew, plot-curves and bench."""

from pathlib import Path
from typing import Annotated

import typer

from formation_env.cli_errors import DISTRIBUTION
from formation_env.cli_options import MAX_EPISODES, Episodes
from formation_env.files import check_writable, is_checkout

PROGRAM = f"{DISTRIBUTION} agents"
Bounds = Annotated[Path, typer.Option(file_okay=False, help="Folder of the cached bounds.")]
AllowPickle = Annotated[bool, typer.Option("--allow-pickle", help="Load a .zip, which can run any code.")]
ThrottlePower = Annotated[
    float | None,
    typer.Option(min=0.01, help="p where a .zip's actions z mean thrusts sign(z)|z|^p", show_default="1"),
]
Runs = Annotated[list[Path], typer.Argument(help="Folders of training runs.")]
BOUNDS = Path("reports/bounds")
"""The report caches its bounds in the same folder."""


def add_result_commands(app: typer.Typer) -> None:
    """Add the commands to a group."""
    app.command(epilog=f"Example: {PROGRAM} evaluate runs/mine --episodes 20")(evaluate)
    app.command(epilog=f"Example: {PROGRAM} export runs/a runs/b runs/c --out policies")(export)
    app.command(epilog=f"Example: {PROGRAM} renew policies/ppo_keeping.safetensors")(renew)
    app.command("plot-curves", epilog=f"Example: {PROGRAM} plot-curves runs/mine --out curves")(plot_curves)
    app.command(epilog=f"Example: {PROGRAM} bench FormationKeeping-v0 --threads 1")(bench)


def evaluate(
    source: Annotated[Path, typer.Argument(help="A .safetensors file, a run's folder, or an SB3 model (.zip).")],
    env: Annotated[str | None, typer.Argument(help="Environment", show_default="the one of its training")] = None,
    episodes: Episodes = 100,
    bound_episodes: Annotated[
        int, typer.Option(min=0, max=MAX_EPISODES, help="Seeds for which the bound is solved; 0 disables it.")
    ] = 20,
    bounds: Bounds = BOUNDS,
    allow_pickle: AllowPickle = False,
    throttle_power: ThrottlePower = None,
) -> None:
    """Evaluate a policy on the test episodes: mean and 95 % interval of each metric, and cost over the bound."""
    from agents.results.evaluate import choose, score

    if allow_pickle and source.suffix == ".zip":
        warn_of_pickle(str(source))
    policy, scenario = choose(source, env, allow_pickle, throttle_power)
    if getattr(policy, "scenario", scenario) != scenario:
        typer.echo(f"note: {source} was trained on another scenario than {env}", err=True)
    typer.echo(score(policy, scenario, episodes, bound_episodes, bounds).to_string(float_format="{:.4g}".format))


def warn_of_pickle(source: str) -> None:
    """Say on stderr that a file's code is run."""
    typer.echo(f"warning: {source}: its pickled objects are executed", err=True)


def export(
    runs: Runs,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for the policy's files", show_default="agents/policies")
    ] = None,
) -> None:
    """Write the policy with the best validation cost: tensors, a card with all runs' test results, an ONNX graph."""
    from agents.policy.library import SHIPPED
    from agents.results.export import export as export_runs
    from formation_env.settings import ConfigError

    if out is None and not is_checkout():
        raise ConfigError("export: the shipped policies belong to the installed package; give --out FOLDER")
    folder = out or SHIPPED
    check_writable(folder)
    typer.echo(export_runs(runs, folder))


def renew(
    policies: Annotated[
        list[Path] | None, typer.Argument(help="Policies (.safetensors).", show_default="the shipped ones")
    ] = None,
) -> None:
    """Fly exported policies again after a change of the environment, and renew the test results of their cards."""
    from agents.policy.library import shipped_paths
    from agents.results.export import renew as renew_card
    from formation_env.settings import ConfigError

    if policies is None and not is_checkout():
        raise ConfigError("renew: the shipped policies belong to the installed package; name a policy of your own")
    for path in policies or shipped_paths():
        check_writable(path.parent)
        renew_card(path)
        typer.echo(path)


def plot_curves(
    runs: Runs,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder for the pictures, learning_ENVIRONMENT.png.")],
    policy: Annotated[list[str], typer.Option(help="Classical policy drawn as a level; may be repeated.")] = [  # noqa: B006
        "lqr",
        "lqr_nominal",
    ],
    bounds: Bounds = BOUNDS,
) -> None:
    """Plot learning curves, one picture per environment, with classical policies on the same validation episodes."""
    from agents.results.curve import draw

    check_writable(out)
    for picture in draw(runs, out, policy, bounds):
        typer.echo(picture)


def bench(
    env: Annotated[str, typer.Argument(help="Registered id, scenario name or YAML file.")] = "FormationKeeping-v0",
    threads: Annotated[list[int], typer.Option(min=1, help="Threads of torch; may be repeated.")] = [1, 2],  # noqa: B006
    rounds: Annotated[int, typer.Option(min=1, help="Rollouts with their updates; the fastest counts.")] = 5,
) -> None:
    """Measure the training speed of PPO with its default settings, and the environment's share of the time."""
    from agents.results.bench import table

    typer.echo(f"PPO on {env}\n{table(env, threads, rounds)}")
