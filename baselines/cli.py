"""The commands `report`, `reproduce` and `sweep`. Their libraries are imported only when they run."""

import os
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn

import typer

from baselines.controllers.registry import reference_policies, slow_policies
from baselines.experiments.policy_factories import classical
from baselines.optimal.cone_solver import SOLVER
from formation_env.settings import ConfigError
from formation_env.task.loading import ENV_IDS

Envs = Annotated[list[str] | None, typer.Option("--env", help="Id, scenario name or YAML file; may be repeated.")]
Policies = Annotated[list[str] | None, typer.Option("--policy", help="Name of a policy; may be repeated.")]
Episodes = Annotated[int, typer.Option(min=1, help="Episodes per policy and environment.")]
SlowEpisodes = Annotated[int, typer.Option(min=1, help="Of these the first ones, for mpc, which is slow.")]
SweepEpisodes = Annotated[int, typer.Option(min=0, help="For fronts and robustness; 0 leaves them out.")]
BoundEpisodes = Annotated[int, typer.Option(min=0, help="Of these, for the fronts' bound; 0 is none.")]
Fine = Annotated[bool, typer.Option("--fine", help="Fronts and robustness at more values.")]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder to write to.")]
Processes = Annotated[int, typer.Option(min=1, help="To fly in.")]
Resume = Annotated[bool, typer.Option("--resume", help="Keep finished flights in OUT/flown; fly none of them again.")]
PROCESSES: Final = min(2, os.cpu_count() or 1)


def report(
    env: Envs = None,
    policy: Policies = None,
    episodes: Episodes = 100,
    slow_episodes: SlowEpisodes = 5,
    sweep_episodes: SweepEpisodes = 10,
    bound_episodes: BoundEpisodes = 2,
    fine: Fine = False,
    resume: Resume = False,
    out: Out = Path("reports"),
    processes: Processes = PROCESSES,
) -> None:
    """Fly the classical policies on the same seeds, and write tables and an HTML page."""
    command = shlex.join(["python", "-m", "baselines", *sys.argv[1:]])

    def write() -> Path:
        from baselines.report import ReportOptions, write_report

        options = ReportOptions(
            episodes=episodes,
            slow_episodes=slow_episodes,
            sweep_episodes=sweep_episodes,
            sweep_bound_episodes=bound_episodes,
            coarse=not fine,
            resume=resume,
        )
        return write_report(classical(policy or (), env or ()), env or list(ENV_IDS), options, out, command, processes)

    run_report("report", out, write)


def reproduce(
    episodes: Annotated[int, typer.Option(min=1, help="Test seeds of each flight with noise.")] = 50,
    out: Out = Path("reports/thesis"),
    step_s: Annotated[
        float, typer.Option(min=0.1, max=60.0, help="Time step, s; a coarse one for a quick look.")
    ] = 1.0,
    claims: Annotated[bool, typer.Option(help="Judge the claims, too.")] = True,
    models: Annotated[bool, typer.Option(help="Hold the linear models against the nonlinear truth, too.")] = True,
    processes: Processes = PROCESSES,
) -> None:
    """Redraw the thesis's figures, judge its claims and its models, and write all of it, with one HTML page."""
    command = shlex.join(["python", "-m", "baselines", *sys.argv[1:]])

    def write() -> Path:
        from baselines.thesis.report import Wanted, write_thesis

        return write_thesis(out, Wanted(episodes, step_s, claims=claims, models=models), command, processes)

    run_report("reproduce", out, write)


def sweep(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Ids, names or YAML files, as --env.")] = None,
    env: Envs = None,
    policy: Policies = None,
    episodes: Annotated[int, typer.Option(min=1, help="Test seeds of each point.")] = 20,
    bound_episodes: Annotated[int, typer.Option(min=0, help="Of these, seeds of the bound's front; 0 is none.")] = 5,
    resume: Resume = False,
    out: Out = Path("reports/sweep"),
    processes: Processes = PROCESSES,
) -> None:
    """Draw thrust against error as its price moves, and cost against noise, outages, limits and wrong models."""
    command = shlex.join(["python", "-m", "baselines", *sys.argv[1:]])
    envs = [*(scenarios or ()), *(env or ())] or list(ENV_IDS)
    names = policy or [name for name in classical() if name not in (*slow_policies(), *reference_policies())]

    def write() -> Path:
        from baselines.report.write_sweep import SweepOptions, write_sweep

        options = SweepOptions(episodes=episodes, bound_episodes=bound_episodes, resume=resume)
        return write_sweep(classical(names, envs), envs, options, out, command, processes)

    run_report("sweep", out, write)


def run_report(name: str, out: Path, write: Callable[[], Path]) -> None:
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
        _end(f"{name}: interrupted, no report written", 130)
    except ModuleNotFoundError as error:
        missing = str(error.name).split(".")[0]
        extra = "optimal" if missing == SOLVER else "report"
        _end(f"{name}: needs {missing}; install it with: pip install 'formation-env[{extra}]'", 1)
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
