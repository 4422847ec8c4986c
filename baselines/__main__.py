"""Command line of the classical policies."""

import typer

from baselines.cli import report, reproduce, sweep
from baselines.cli_render import render
from baselines.cli_tune import tune

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)
app.command()(tune)
app.command()(report)
app.command()(reproduce)
app.command()(sweep)
app.command()(render)

if __name__ == "__main__":
    app()
