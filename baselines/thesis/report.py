"""From flights to files: the figures one by one, the page that holds them all, and the claims as tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from tqdm import tqdm

from baselines.report.document import versions
from baselines.thesis import jobs, plan, tables
from baselines.thesis.claim import Claim
from baselines.thesis.figures import FIGURES, Figure, style
from baselines.thesis.flights import Flights
from baselines.thesis.page import Picture, render
from formation_env.files import write_files
from formation_env.scenario import load_scenario
from formation_env.seeds import seeds

PAGE: Final = "thesis.html"


def write_thesis(
    out: Path,
    episodes: int,
    command: str,
    workers: int,
    step_s: float | None = None,
    periods: float = 10.0,
    claims: Sequence[Claim] = (),
    model_errors: Sequence[Picture] = (),
) -> Path:
    """Fly what the thesis flew, and write its figures and the page; files appear only when all are complete.

    Args:
        out: folder to write to; made if it does not exist.
        episodes: test seeds of each flight with noise.
        command: the command line that redoes it; noted on the page.
        workers: processes to fly in.
        step_s: time step, s; the shipped scenarios' 1 s if left out.
        periods: keeping time, in periods of the orbit.
        claims: lines of the claims table.
        model_errors: figures of what the linear world hides.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a step that does not fit the scenarios.
        ValueError: too many episodes.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    flown = fly(plan.jobs(seeds("test", episodes), step_s, periods), workers)
    contents: dict[str, bytes] = {}
    pictures = []
    with style.settings():
        for number, figure in tqdm(FIGURES.items(), desc="drawing", unit="figure", dynamic_ncols=True):
            pictures.append(_draw(number, figure, flown, contents))
    step_s = step_s or load_scenario("thesis_keeping").dt_s
    facts = {"command": command, "episodes": episodes, "step_s": f"{step_s:g}", "versions": versions()}
    contents[PAGE] = render(pictures, claims, model_errors, facts).encode()
    if claims:
        contents |= {"claims.csv": tables.to_csv(claims).encode(), "claims.json": tables.to_json(claims).encode()}
    write_files(out, contents)
    return out / PAGE


def fly(wanted: Mapping[str, jobs.Job], workers: int) -> dict[str, Flights]:
    """Fly all jobs with a progress bar.

    Args:
        wanted: by name.
        workers: processes.
    """
    total = sum(job.cost for job in wanted.values())
    first = "flying (the very first run compiles the kernel)"
    with tqdm(total=total, desc=first, unit="step", unit_scale=True, smoothing=0.1, dynamic_ncols=True) as bar:
        return jobs.run(wanted, bar.update, workers)


def _draw(number: str, figure: Figure, flown: Mapping[str, Flights], contents: dict[str, Any]) -> Picture:
    """Draw a figure, add its files to the folder's contents, and give it as it stands on the page."""
    images = style.images(figure.draw(flown))
    picture = Picture(number, figure.title, figure.sentence, figure.note(number, flown), images["svg"])
    contents |= {f"{picture.anchor}.{kind}": image for kind, image in images.items()}
    return picture
