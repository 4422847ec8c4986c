"""From flights to files: the figures one by one, the page that holds them all, and the claims as tables."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from tqdm import tqdm

from baselines.experiments import parallel
from baselines.report.json_document import versions
from baselines.thesis import plan, tables
from baselines.thesis.claims import table
from baselines.thesis.claims.flights import Effort
from baselines.thesis.figures import FIGURES, Figure, style
from baselines.thesis.flights import Flights
from baselines.thesis.models import report
from baselines.thesis.report_page import Content, Picture, Table, render
from formation_env.evaluation.seeds import seeds
from formation_env.files import write_files

PAGE: Final = "thesis.html"
READINGS_TEXT: Final = (
    "Which reading of the printed settings gives Figure 5.7: 300 m, below 4e-3 m/s², mostly across the plane."
)
NOISE_TEXT: Final = "The thesis is silent on noise; here is each sentence that may depend on it, at each level."
FAIR_TEXT: Final = (
    "Both laws with the path's own thrust, each tuned over as many candidates for delta-v plus a price times the mean "
    "error, on linear and nonlinear truth."
)


@dataclass(frozen=True)
class Wanted:
    """What to reproduce.

    Attributes:
        episodes: test seeds of each flight with noise.
        step_s: time step of the figures and of the main claims, s.
        periods: keeping time, in periods of the orbit.
        claims: whether the claims are judged, too; their noise grid and their fair comparison take longest.
        models: whether the linear models are held against the nonlinear truth, too.
    """

    episodes: int = 50
    step_s: float = 1.0
    periods: float = 10.0
    claims: bool = True
    models: bool = True

    @property
    def effort(self) -> Effort:
        """The claims' share."""
        steps = (self.step_s, max(self.step_s, Effort.coarse_dt_s), max(self.step_s, Effort.grid_dt_s))
        dt_s, coarse_dt_s, grid_dt_s = steps
        return Effort(seeds=self.episodes, dt_s=dt_s, coarse_dt_s=coarse_dt_s, grid_dt_s=grid_dt_s)


def write_thesis(out: Path, wanted: Wanted, command: str, workers: int) -> Path:
    """Fly what the thesis flew, and write figures, claims and the page; files appear only when all are complete.

    Args:
        out: folder to write to; made if it does not exist.
        wanted: what to reproduce.
        command: the command line that redoes it; noted on the page.
        workers: processes to fly in.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a step that does not fit the scenarios.
        ValueError: too many episodes.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    work: dict[str, parallel.Job] = dict(plan.jobs(seeds("test", wanted.episodes), wanted.step_s, wanted.periods))
    if wanted.claims:
        work |= table.jobs(wanted.effort)
    if wanted.models:
        work |= report.jobs(seeds("test", wanted.episodes))
    flown = parallel.run_with_bar(work, workers)
    contents: dict[str, bytes] = {}
    with style.settings():
        bar = tqdm(FIGURES.items(), desc="drawing", unit="figure", dynamic_ncols=True)
        pictures = [_draw(number, figure, flown, contents) for number, figure in bar]
        content = Content(pictures)
        if wanted.models:
            content = report.shown(content, report.found(flown), contents)
    if wanted.claims:
        content = judged(content, table.tables(flown, wanted.effort), contents)
    facts = {"episodes": wanted.episodes, "step_s": f"{wanted.step_s:g}", "command": command, "versions": versions()}
    contents[PAGE] = render(content, facts).encode()
    write_files(out, contents)
    return out / PAGE


def judged(content: Content, found: table.Tables, contents: dict[str, bytes]) -> Content:
    """The page's content with the claims, whose files are added to the folder's contents."""
    below = (
        Table("readings", "Readings of section 5.2.2", READINGS_TEXT, found.readings),
        Table("noise", "Verdicts over the noise", NOISE_TEXT, found.noise),
        Table("fair", "LQR and SMC, tuned alike", FAIR_TEXT, found.fair),
    )
    contents |= {
        "claims.csv": tables.to_csv(found.claims).encode(),
        "claims.json": tables.to_json(found.claims).encode(),
    }
    contents |= {f"{table.name}.csv": table.data.to_csv(index=False).encode() for table in below}
    return replace(content, claims=found.claims, tables=below)


def _draw(number: str, figure: Figure, flown: Mapping[str, Flights], contents: dict[str, Any]) -> Picture:
    """Draw a figure, add its files to the folder's contents, and give it as it stands on the page."""
    images = style.images(figure.draw(flown))
    picture = Picture(number, figure.title, figure.sentence, figure.note(number, flown), images["svg"])
    contents |= {f"{picture.anchor}.{kind}": image for kind, image in images.items()}
    return picture
