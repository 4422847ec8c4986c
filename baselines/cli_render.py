"""The `render` command: a picture of a flight."""

from pathlib import Path
from typing import Annotated

import typer

from baselines.controllers.registry import make_policy


def render(
    env: Annotated[str, typer.Argument(help="A registered id, or a scenario's name or YAML file.")],
    out: Annotated[Path, typer.Option(help="PNG file to write.")],
    policy: Annotated[str, typer.Option(help="Name of the policy that flies.")] = "lqr",
    steps: Annotated[int, typer.Option(min=0, help="Steps to fly before the picture is taken.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the episode.")] = 0,
) -> None:
    """Fly some steps of an episode and save the picture of that moment."""
    from formation_env.evaluation.snapshot import save_frame

    save_frame(out, env, steps, seed=seed, policy=make_policy(policy, env))
    typer.echo(out)
