"""The command `report`: its options stand here once, for the reports with and without learned policies."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formation_env.cli_errors import on_interrupt
from formation_env.cli_options import MAX_EPISODES, PROCESSES, Envs, Episodes, Out, Policies, Processes, Resume
from formation_env.files import check_writable

if TYPE_CHECKING:
    from baselines.report import ReportOptions

SlowEpisodes = Annotated[
    int, typer.Option(min=1, max=MAX_EPISODES, help="Episodes flown by slow policies (mpc): the first N.")
]
SweepEpisodes = Annotated[
    int, typer.Option(min=0, max=MAX_EPISODES, help="Seeds of trade-off fronts and robustness; 0 disables both.")
]
BoundEpisodes = Annotated[
    int,
    typer.Option(min=0, max=MAX_EPISODES, help="Seeds for which the trade-off bound is solved; 0 disables it."),
]
Fine = Annotated[bool, typer.Option("--fine", help="More values of each quantity in fronts and robustness.")]


@dataclass(frozen=True, kw_only=True)
class ReportArguments:
    """Fly the classical policies on the same test episodes, and write tables and an HTML page."""

    envs: Envs = None
    policy: Policies = None
    episodes: Episodes = 100
    slow_episodes: SlowEpisodes = 5
    sweep_episodes: SweepEpisodes = 10
    bound_episodes: BoundEpisodes = 2
    fine: Fine = False
    resume: Resume = False
    out: Out = Path("reports")
    processes: Processes = PROCESSES

    def options(self) -> "ReportOptions":
        """Options of the report."""
        from baselines.report import ReportOptions

        return ReportOptions(
            episodes=self.episodes,
            slow_episodes=self.slow_episodes,
            sweep_episodes=self.sweep_episodes,
            sweep_bound_episodes=self.bound_episodes,
            coarse=not self.fine,
            resume=self.resume,
        )


def write_report_page(out: Path, resume: bool, write: Callable[[], Path]) -> None:
    """Write a report's files and print the page's path.

    Args:
        out: the report's folder; that it can be written is checked before the first episode.
        resume: whether finished episodes are saved in it.
        write: flies and writes; gives the page's path.
    """
    check_writable(out)
    kept = f"finished episodes are saved in {out}; the same command continues" if resume else "no report written"
    with on_interrupt(f"interrupted, {kept}"):
        page = write()
    typer.echo(f"wrote {page}")
