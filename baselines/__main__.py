"""Command line of the classical policies."""

import typer

from baselines.commands import report
from baselines.tuning import tune

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)
app.callback()(lambda: None)  # so that a single command keeps its name
app.command()(tune)
app.command()(report)

if __name__ == "__main__":
    app()
