"""The program `formation-env`: the group `env`, and the groups of other packages."""

from collections.abc import Sequence
from typing import Annotated, ClassVar

import typer

from formation_env import __version__
from formation_env.cli_env import COMMANDS, FORMER_COMMANDS
from formation_env.cli_env import app as env_app
from formation_env.cli_errors import DISTRIBUTION
from formation_env.cli_group import RootGroup, make_app


class Root(RootGroup):
    """The program; commands of the group `env` once stood at its top level."""

    renamed: ClassVar = {name: f"{DISTRIBUTION} env {name}" for name in COMMANDS} | FORMER_COMMANDS


app = make_app(
    "Satellite formation flying with lossy measurements: environments, classical policies and RL agents.", Root
)
app.add_typer(env_app, name="env")


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"{DISTRIBUTION} {__version__}")
        raise typer.Exit


@app.callback(epilog=f"Example: {DISTRIBUTION} baselines report keeping --episodes 20")
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Satellite formation flying with lossy measurements: environments, classical policies and RL agents.

    Exit codes: 0 fine, 1 the work failed, 2 the input is wrong, 130 interrupted.
    """


def with_group(arguments: Sequence[str]) -> list[str]:
    """Arguments of `python -m formation_env`, which may leave out the group `env`."""
    known = (*COMMANDS, *FORMER_COMMANDS)
    return ["env", *arguments] if arguments and arguments[0] in known else list(arguments)
