"""Section "What the linear models neglect": its jobs, sentences, table and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import pandas as pd
from matplotlib.figure import Figure

from baselines.experiments.parallel import Job
from baselines.thesis.figures import style
from baselines.thesis.models import closed_loop_costs, model_figures, model_guide, open_loop_errors
from baselines.thesis.thesis_page import Content, PageTable, Picture

ERRORS, COSTS = "model errors ", "model costs "
GUIDE_TEXT: Final = (
    "Largest size (distance from the leader) up to which the prediction error of every closed formation stays below "
    "the "
    "given accuracy without control, under J2 and with the perigee at 600 km."
)
_SAME: Final = (
    "Leader and follower start with the same states in truth and model. The error is the maximum position error up to "
    "that time. "
)
_NEAR: Final = f"The formations are {model_guide.NEAR_M:g} m large. "


@dataclass(frozen=True)
class ModelResults:
    """Results that the section shows.

    Attributes:
        errors: lines of all surveys of `open_loop_errors`.
        costs: summary of all trials of `closed_loop_costs`.
    """

    errors: pd.DataFrame
    costs: pd.DataFrame


def model_jobs(seeds: Sequence[int]) -> dict[str, Job]:
    """All jobs of the section by name; seeds are those of the closed loops."""
    surveys = [open_loop_errors.Survey(orbit) for orbit in open_loop_errors.leaders()]
    trials = [
        closed_loop_costs.Trial(comparison, truth, tuple(seeds))
        for comparison in closed_loop_costs.COMPARISONS
        for truth in comparison.truths()
    ]
    jobs: list[tuple[str, Job]] = [*((ERRORS, survey) for survey in surveys), *((COSTS, trial) for trial in trials)]
    return {f"{head}{index}": job for index, (head, job) in enumerate(jobs)}


def model_results(flown: Mapping[str, Any]) -> ModelResults:
    """Results of the flown jobs of `model_jobs`."""

    def all_of(head: str) -> pd.DataFrame:
        names = sorted((name for name in flown if name.startswith(head)), key=lambda name: int(name.split()[-1]))
        parts: list[pd.DataFrame] = [flown[name] for name in names]
        return pd.concat(parts, ignore_index=True)

    return ModelResults(all_of(ERRORS), closed_loop_costs.summary(all_of(COSTS)))


def add_section(content: Content, results: ModelResults, contents: dict[str, bytes]) -> Content:
    """The page's content with this section, whose files are added to the folder's contents."""
    enough = model_guide.good_enough(results.errors)
    tables = {"model_errors": results.errors, "model_costs": results.costs, "model_guide": enough}
    contents |= {f"{name}.csv": table.to_csv(index=False).encode() for name, table in tables.items()}
    pictures = []
    for index, (title, note, figure) in enumerate(_figures(results), start=1):
        images = style.images(figure)
        picture = Picture(f"M.{index}", title, "", note, images["svg"])
        contents |= {f"{picture.anchor}.{kind}": image for kind, image in images.items()}
        pictures.append(picture)
    guide = PageTable("model_guide", "Which model is good enough", GUIDE_TEXT, model_guide.guide(enough))
    sentences = model_guide.sentences(results.errors, results.costs)
    return replace(content, model_errors=pictures, model_sentences=sentences, guide=guide)


def _figures(results: ModelResults) -> list[tuple[str, str, Figure]]:
    """Title, note and drawing of each figure."""
    errors, near_m = results.errors, model_guide.NEAR_M
    size = (
        "The leader is on a circular orbit at 600 km and 60°. The dotted line is the error of linearisation alone; the "
        "rest is due to J2. Where lines coincide, the models do not differ."
    )
    falling = (
        "Without J2 only the models' own assumptions remain; for Yamanaka and Ankersen's model that is the "
        "linearisation."
    )
    return [
        ("Model error against size, 1 orbit", _SAME + size, model_figures.against_size(errors, 1)),
        ("Model error against size, 10 orbits", _SAME + size, model_figures.against_size(errors, 10)),
        ("Model error against inclination", _SAME + _NEAR, model_figures.against_inclination(errors, near_m)),
        (
            "Model error against eccentricity",
            _SAME + _NEAR + "The perigee stays at 600 km. The mean radius is defined for circular orbits only.",
            model_figures.against_eccentricity(errors, near_m, j2=True),
        ),
        (
            "Model error against eccentricity, no J2",
            _SAME + _NEAR + falling,
            model_figures.against_eccentricity(errors, near_m, j2=False),
        ),
        (
            "Cost in closed loop, linear and nonlinear",
            "Means and 95 % intervals; on the right, of the paired differences. Settings are those of the scenario's "
            "file; "
            "keeping_eccentric uses those of keeping. The filter model is modified HCW, in keeping_eccentric Yamanaka "
            "and Ankersen's model, unless stated otherwise.",
            model_figures.costs(results.costs),
        ),
    ]
