"""Reproduction of the thesis: fly, draw the figures, decide the claims, and write the files and the page."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from tqdm import tqdm

from baselines.experiments import parallel
from baselines.report.json_document import versions
from baselines.thesis import claim_files, figure_flights
from baselines.thesis.claims import claims_table
from baselines.thesis.claims.shared_flights import ClaimOptions
from baselines.thesis.figures import FIGURES, Figure, style
from baselines.thesis.models import section
from baselines.thesis.recorded_flights import Flights
from baselines.thesis.thesis_page import Content, PageTable, Picture, render
from formation_env.evaluation.seeds import seeds
from formation_env.files import write_files

PAGE: Final = "thesis.html"
THESIS_STEP_S: Final = 1.0
"""Time step of the shipped thesis scenarios, for which the verdicts are stated, s."""
READINGS_TEXT: Final = (
    "Which reading of the printed settings gives Figure 5.7: 300 m, below 4e-3 m/s², mostly across the orbit plane."
)
NOISE_TEXT: Final = "The thesis states no noise levels. Each statement that may depend on them, at each level."
FAIR_TEXT: Final = (
    "Both laws include the feedforward thrust of the path, and each is tuned over the same number of candidates for "
    "delta-v plus a weighted mean error, on linear and nonlinear truth."
)


@dataclass(frozen=True, kw_only=True)
class ThesisOptions:
    """Options of the reproduction.

    Attributes:
        episodes: test seeds of each flight with noise.
        step_s: time step of the figures and of the main claims, s.
        periods: keeping time, in periods of the orbit.
        claims: whether the claims are decided; their noise grid and their tuned comparison take longest.
        models: whether the linear models are compared with the nonlinear truth.
    """

    episodes: int = 50
    step_s: float = THESIS_STEP_S
    periods: float = 10.0
    claims: bool = True
    models: bool = True

    @property
    def claim_options(self) -> ClaimOptions:
        """Options of the claims: no step is shorter than `step_s`."""
        return ClaimOptions(
            seeds=self.episodes,
            dt_s=self.step_s,
            coarse_dt_s=max(self.step_s, ClaimOptions.coarse_dt_s),
            grid_dt_s=max(self.step_s, ClaimOptions.grid_dt_s),
        )

    @property
    def step_warning(self) -> str:
        """Warning that the step is not the thesis's; empty if it is."""
        if self.step_s == THESIS_STEP_S:
            return ""
        return (
            f"Time step {self.step_s:g} s instead of the thesis's {THESIS_STEP_S:g} s: verdicts can differ from those "
            f"at {THESIS_STEP_S:g} s."
        )


def write_thesis(out: Path, options: ThesisOptions, command: str, workers: int) -> Path:
    """Fly what the thesis flew, and write figures, claims and the page; files appear only when all are complete.

    Args:
        out: folder to write to; created if it does not exist.
        options: what to reproduce.
        command: command line that repeats this run; noted on the page.
        workers: number of worker processes.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a step that does not fit the scenarios.
        ValueError: too many episodes.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    if options.step_warning:
        print(options.step_warning, file=sys.stderr)
    flown = parallel.run_with_bar(_jobs(options), workers)
    contents: dict[str, bytes] = {}
    with style.settings():
        bar = tqdm(FIGURES.items(), desc="drawing", unit="figure", dynamic_ncols=True)
        content = Content([_draw(number, figure, flown, contents) for number, figure in bar])
        if options.models:
            content = section.add_section(content, section.model_results(flown), contents)
    if options.claims:
        content = add_claims(content, claims_table.tables(flown, options.claim_options), contents)
    facts = {
        "episodes": options.episodes,
        "step_s": f"{options.step_s:g}",
        "step_warning": options.step_warning,
        "command": command,
        "versions": versions(),
    }
    contents[PAGE] = render(content, facts).encode()
    write_files(out, contents)
    return out / PAGE


def _jobs(options: ThesisOptions) -> dict[str, parallel.Job]:
    """All jobs of a reproduction, by name."""
    test_seeds = seeds("test", options.episodes)
    jobs: dict[str, parallel.Job] = dict(figure_flights.figure_jobs(test_seeds, options.step_s, options.periods))
    if options.claims:
        jobs |= claims_table.claim_jobs(options.claim_options)
    if options.models:
        jobs |= section.model_jobs(test_seeds)
    return jobs


def add_claims(content: Content, decided: claims_table.ClaimTables, contents: dict[str, bytes]) -> Content:
    """The page's content with the claims, whose files are added to the folder's contents."""
    below = (
        PageTable("readings", "Readings of section 5.2.2", READINGS_TEXT, decided.readings),
        PageTable("noise", "Verdicts by noise level", NOISE_TEXT, decided.noise),
        PageTable("fair", "LQR and SMC, tuned alike", FAIR_TEXT, decided.fair),
    )
    contents |= {
        "claims.csv": claim_files.to_csv(decided.claims).encode(),
        "claims.json": claim_files.to_json(decided.claims).encode(),
    }
    contents |= {f"{table.name}.csv": table.data.to_csv(index=False).encode() for table in below}
    return replace(content, claims=decided.claims, tables=below)


def _draw(number: str, figure: Figure, flown: Mapping[str, Flights], contents: dict[str, bytes]) -> Picture:
    """Draw a figure, add its files to the folder's contents, and return its entry of the page."""
    images = style.images(figure.draw(flown))
    picture = Picture(number, figure.title, figure.sentence, figure.note(number, flown), images["svg"])
    contents |= {f"{picture.anchor}.{kind}": image for kind, image in images.items()}
    return picture
