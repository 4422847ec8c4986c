"""The commands of `formation-env env`. What they need is imported when they run."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

import typer

from formation_env import cli_bench
from formation_env.cli_errors import DISTRIBUTION, WRONG_INPUT
from formation_env.cli_group import Group, make_app
from formation_env.cli_options import Env, Seed
from formation_env.cli_policies import make_policy

if TYPE_CHECKING:
    from formation_env.task.scenario import Scenario

COMMANDS: Final = (
    "list",
    "show",
    "kinds",
    "schema",
    "validate",
    "show-observation",
    "render",
    "bench",
    "compile",
    "soak",
)
FORMER_COMMANDS: Final = {
    "scenarios": f"{DISTRIBUTION} env list",
    "check": f"{DISTRIBUTION} env validate",
    "observation": f"{DISTRIBUTION} env show-observation",
}


class EnvGroup(Group):
    """The group `env`."""

    renamed: ClassVar = FORMER_COMMANDS
    renamed_options: ClassVar = {"bench": {"--sb3": f"{DISTRIBUTION} agents bench"}}


app = make_app("Scenarios and environments: list, describe, validate, render and time them.", EnvGroup)


@app.command("list", epilog=f"Example: {DISTRIBUTION} env list")
def list_scenarios() -> None:
    """List the scenarios of the package: name, registered id if there is one, title."""
    from formation_env.task.loading import ENV_IDS, SWARM_IDS, load_scenario, scenario_names, swarm_names

    ids = {name: env_id for env_id, name in (ENV_IDS | SWARM_IDS).items()}
    for name in (*scenario_names(), *swarm_names()):
        typer.echo(f"{name:26s} {ids.get(name, ''):28s} {load_scenario(name).title}")


@app.command(epilog=f"Example: {DISTRIBUTION} env show keeping > mine.yaml")
def show(scenario: Env) -> None:
    """Print a scenario as YAML with every key, defaults included; a start for a scenario file."""
    from formation_env.task.loading import load_scenario

    typer.echo(to_yaml(load_scenario(scenario)), nl=False)


def to_yaml(scenario: "Scenario") -> str:
    """A scenario as a YAML file that loads as an equal one."""
    from dataclasses import asdict

    from formation_env.configuration.config_files import dump_yaml

    return dump_yaml(_plain(asdict(scenario)), inline=False)


def _plain(value: object) -> object:
    """Lists in place of tuples, which YAML does not know."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


@app.command(epilog=f"Example: {DISTRIBUTION} env kinds")
def kinds() -> None:
    """List the kinds of formation, dropout and dynamics with their keys: type, default and meaning."""
    from formation_env.task.loading import kinds as kinds_of

    for group, members in kinds_of().items():
        typer.echo(f"{group}:")
        for kind, keys in members.items():
            typer.echo(f"  {kind}")
            for key, description in keys.items():
                typer.echo(f"    {key:22s} {description}")


@app.command(epilog=f"Example: {DISTRIBUTION} env schema > scenario.schema.json")
def schema() -> None:
    """Print the JSON Schema of scenario files; editors complete and check keys with it."""
    import json

    from formation_env.task.loading import scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))


@app.command(epilog=f"Example: {DISTRIBUTION} env validate mine.yaml")
def validate(
    files: Annotated[list[str], typer.Argument(help="YAML files, scenario names or registered ids.")],
) -> None:
    """Validate scenarios: faults, or size, thrust authority, range and warnings. Exit code 2 if there is a fault."""
    from formation_env.settings import ConfigError

    faulty = False
    for file in files:
        try:
            _validate_one(file)
        except ConfigError as error:
            typer.echo(error, err=True)
            faulty = True
    if faulty:
        raise typer.Exit(WRONG_INPUT)


def _validate_one(file: str) -> None:
    """Print the facts of a scenario, and on stderr its warnings.

    Raises:
        ConfigError: the scenario is wrong.
    """
    from formation_env.task.domain import DomainWarning, facts_of, warnings_of
    from formation_env.task.loading import load_scenario

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DomainWarning)  # they are printed below, with others
        scenario = load_scenario(file)
    typer.echo(f"{file}: valid")
    for name, number in facts_of(scenario).items():
        typer.echo(f"  {name:28s} {number:.6g}")
    for warning in warnings_of(scenario):
        typer.echo(f"{file}: warning: {warning}", err=True)


@app.command("show-observation", epilog=f"Example: {DISTRIBUTION} env show-observation keeping")
def show_observation(
    env: Annotated[str | None, typer.Argument(help="Also print the scales of this environment.")] = None,
) -> None:
    """Print the table of the observation's elements: meaning, unit and scale."""
    from formation_env.task.loading import load_scenario
    from formation_env.task.observation import NEIGHBOUR_BLOCKS, markdown_table, observation_layout

    scenario = None if env is None else load_scenario(env)
    typer.echo(markdown_table())
    if scenario is not None:
        layout = observation_layout(scenario)
        if layout.num_neighbours:
            typer.echo(
                f"\nBehind it, for each of {layout.num_neighbours} neighbours:\n\n{markdown_table(NEIGHBOUR_BLOCKS)}"
            )
        typer.echo(
            f"\nL = {layout.length_m:g} m, n = {layout.mean_motion_rad_s:.6g} rad/s, "
            f"period = {layout.period_s:.6g} s, dt = {scenario.dt_s:g} s, phases = {layout.num_phases}"
        )


@app.command(epilog=f"Example: {DISTRIBUTION} env render keeping --policy lqr --steps 100 --out keeping.png")
def render(
    env: Env,
    out: Annotated[Path, typer.Option(dir_okay=False, help="PNG file to write.")],
    policy: Annotated[str | None, typer.Option(help="Policy that acts; the follower coasts without one.")] = None,
    steps: Annotated[int, typer.Option(min=0, help="Steps before the picture is taken.")] = 100,
    seed: Seed = 0,
) -> None:
    """Fly some steps of an episode and save a picture of that instant."""
    from formation_env.evaluation.snapshot import save_frame
    from formation_env.files import check_writable
    from formation_env.settings import ConfigError
    from formation_env.task.loading import load_scenario

    if out.suffix.lower() != ".png":
        raise ConfigError(f"--out: must end in .png, got {out}")
    scenario = load_scenario(env)
    check_writable(out.parent)
    if steps > scenario.num_steps:
        typer.echo(f"note: --steps: the episode has {scenario.num_steps} steps; the picture shows its end", err=True)
    save_frame(out, scenario, min(steps, scenario.num_steps), seed, make_policy(policy, scenario))
    typer.echo(out)


app.command(epilog=f"Example: {DISTRIBUTION} env bench keeping --rows 1024 --plot keeping.png")(cli_bench.bench)
app.command("compile", epilog=f"Example: {DISTRIBUTION} env compile keeping")(cli_bench.compile_programs)
app.command(epilog=f"Example: {DISTRIBUTION} env soak keeping --steps 1e8")(cli_bench.soak)
