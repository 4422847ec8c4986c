"""Options that mean the same in every command."""

import os
from pathlib import Path
from typing import Annotated, Final

import typer

MAX_EPISODES: Final = 1_000_000
"""Seeds in each split, see `formation_env.evaluation.seeds`."""
PROCESSES: Final = min(2, os.cpu_count() or 1)
"""Worker processes by default: few enough for a laptop."""

Env = Annotated[str, typer.Argument(help="Registered id, scenario name or YAML file.", show_default=False)]
Envs = Annotated[
    list[str] | None, typer.Argument(help="Registered ids, scenario names or YAML files.", show_default=False)
]
Episodes = Annotated[int, typer.Option(min=1, max=MAX_EPISODES, help="Test episodes per policy and environment.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed.")]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder for the results.")]
Processes = Annotated[int, typer.Option(min=1, help="Number of worker processes.")]
Policies = Annotated[list[str] | None, typer.Option("--policy", help="Name of a policy; may be repeated.")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue an interrupted run from the episodes in OUT.")]
