"""The commands `report` and `reproduce`. Their libraries are imported only when they run."""

import os
import shlex
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from baselines.registry import POLICIES, SLOW, make_policy
from formation_env.envs import ENV_IDS
from formation_env.settings import ConfigError

if TYPE_CHECKING:
    from baselines.report.flights import PolicyFactory

Envs = Annotated[list[str] | None, typer.Option("--env", help="Id, scenario name or YAML file; may be repeated.")]
Policies = Annotated[list[str] | None, typer.Option("--policy", help="Name of a policy; may be repeated.")]
Episodes = Annotated[int, typer.Option(min=1, help="Episodes per policy and environment.")]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder to write to.")]


def report(env: Envs = None, policy: Policies = None, episodes: Episodes = 100, out: Out = Path("reports")) -> None:
    """Fly the classical policies on the same seeds, and write tables and an HTML page; mpc, which is slow, if named."""
    names = policy or [name for name in POLICIES if name not in SLOW]
    policies = {name: partial(make_policy, name) for name in names}
    run_report(policies, env or list(ENV_IDS), episodes, out, "baselines")


def run_report(
    policies: "Mapping[str, PolicyFactory]", envs: Sequence[str], episodes: int, out: Path, package: str
) -> None:
    """Write the report, and end the program with one line if that fails.

    Args:
        policies: label -> factory, see `baselines.report.write_report`.
        envs: ids, names or files of scenarios.
        episodes: seeds per environment.
        out: folder to write to.
        package: whose command line this is.

    Raises:
        SystemExit: 2 after a mistake in the options, 1 after another failure, 130 after an interrupt.
    """
    command = shlex.join(["python", "-m", package, *sys.argv[1:]])

    def write() -> Path:
        from baselines.report import write_report

        return write_report(policies, envs, episodes, out, command)

    _run("report", out, write)


def reproduce(
    episodes: Annotated[int, typer.Option(min=1, help="Test seeds of each flight with noise.")] = 50,
    out: Out = Path("reports/thesis"),
    step_s: Annotated[
        float, typer.Option(min=0.1, max=60.0, help="Time step, s; a coarse one for a quick look.")
    ] = 1.0,
    claims: Annotated[bool, typer.Option(help="Judge the claims, too.")] = True,
    models: Annotated[bool, typer.Option(help="Hold the linear models against the nonlinear truth, too.")] = True,
    processes: Annotated[int, typer.Option(min=1, help="To fly in.")] = min(2, os.cpu_count() or 1),
) -> None:
    """Redraw the thesis's figures, judge its claims and its models, and write all of it, with one HTML page."""
    command = shlex.join(["python", "-m", "baselines", *sys.argv[1:]])

    def write() -> Path:
        from baselines.thesis.report import Wanted, write_thesis

        return write_thesis(out, Wanted(episodes, step_s, claims=claims, models=models), command, processes)

    _run("reproduce", out, write)


def _run(name: str, out: Path, write: Callable[[], Path]) -> None:
    """Write a report, and end the program with one line if that fails.

    Args:
        name: of the command.
        out: folder that it writes to.
        write: does it, and gives the page's path.

    Raises:
        SystemExit: 2 after a mistake in the options, 1 after another failure, 130 after an interrupt.
    """
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        page = write()
    except KeyboardInterrupt:
        _end(f"{name}: interrupted, nothing written", 130)
    except ModuleNotFoundError as error:
        _end(f"{name}: needs {str(error.name).split('.')[0]}; install it with: pip install 'formation-env[report]'", 1)
    except ConfigError as error:
        _end(str(error), 2)
    except OSError as error:
        _end(f"{name}: {out}: cannot be written: {error.strerror or error}", 1)
    finally:
        signal.signal(signal.SIGTERM, before)
    typer.echo(f"wrote {page}")


def _interrupt(*_: Any) -> NoReturn:
    raise KeyboardInterrupt


def _end(message: str, code: int) -> NoReturn:
    typer.echo(message, err=True)
    raise SystemExit(code)
