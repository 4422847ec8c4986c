"""Command line: `python -m formation_env`."""

from pathlib import Path
from typing import Annotated

import typer

from formation_env.settings import ConfigError
from formation_env.task.variants import draw_variants

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def bench(
    rows: Annotated[int, typer.Option(min=1, help="rows of the batched environment")] = 4096,
    sb3: Annotated[bool, typer.Option("--sb3", help="how fast Stable-Baselines3's PPO learns, instead")] = False,
) -> None:
    """Print steps per second beside Gymnasium's own environments, measured in turns in this run."""
    from formation_env.evaluation import bench as benchmark

    if sb3:
        raise typer.Exit(benchmark.learning())
    for name, seconds in benchmark.startup().items():
        typer.echo(f"{name:20s} {seconds:6.2f} s")
    table = benchmark.table(rows)
    formats = {"steps_per_s": "{:,.0f}".format, "x_cartpole": "{:.2f}".format}
    typer.echo(table.to_string(index=False, formatters=formats))


@app.command()
def scenarios() -> None:
    """List the scenarios that come with the package."""
    from formation_env.task.loading import load_scenario, scenario_names

    for name in scenario_names():
        typer.echo(f"{name:26s} {load_scenario(name).title}")


@app.command()
def check(paths: list[Path]) -> None:
    """Check scenario files: one line for each fault, and exit status 1 if there is any."""
    from formation_env.task.loading import load_scenario

    faults = 0
    for path in paths:
        try:
            scenario = load_scenario(path)
        except ConfigError as error:
            typer.echo(error, err=True)
            faults += 1
        else:
            drawn = f", {len(draw_variants(scenario))} variants" if scenario.domain_randomization else ""
            typer.echo(f"{path}: {scenario.num_steps} steps of {scenario.dt_s:g} s{drawn}")
    raise typer.Exit(faults > 0)


@app.command()
def observation() -> None:
    """Print the table of the observation's elements."""
    from formation_env.task.observation import markdown_table

    typer.echo(markdown_table())


if __name__ == "__main__":
    app()
