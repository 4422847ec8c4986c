"""The section on what the linear world hides: what is flown for it, and its sentences, table and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import pandas as pd
from matplotlib.figure import Figure

from baselines.experiments.parallel import Job
from baselines.thesis.figures import style
from baselines.thesis.models import closed_loop_costs, conclusions, open_loop_errors
from baselines.thesis.models import figures as figures
from baselines.thesis.report_page import Content, Picture, Table

ERRORS, COSTS = "model errors ", "model costs "
GUIDE_TEXT: Final = (
    "Greatest size, the distance from the leader, up to which no closed formation strays further from its prediction "
    "than that without control, under J2 and with the perigee at 600 km."
)
_SAME: Final = (
    "Leader and follower start with the same states in the truth and in the model. The error is the greatest one up to "
    "then, of position. "
)
_NEAR: Final = f"The formations are {conclusions.NEAR_M:g} m large. "


@dataclass(frozen=True)
class Found:
    """The numbers of the section.

    Attributes:
        errors: lines of all surveys of `model_errors`.
        costs: summary of all trials of `model_costs`.
    """

    errors: pd.DataFrame
    costs: pd.DataFrame


def jobs(seeds: Sequence[int]) -> dict[str, Job]:
    """All that is flown, by name, for `jobs.run`; seeds are those of the closed loops."""
    surveys = [open_loop_errors.Survey(orbit) for orbit in open_loop_errors.leaders()]
    trials = [
        closed_loop_costs.Trial(comparison, world, tuple(seeds))
        for comparison in closed_loop_costs.COMPARISONS
        for world in comparison.worlds()
    ]
    named = [*((ERRORS, survey) for survey in surveys), *((COSTS, trial) for trial in trials)]
    return {f"{head}{index}": work for index, (head, work) in enumerate(named)}


def found(flown: Mapping[str, Any]) -> Found:
    """The numbers from what `jobs` gave when flown."""

    def all_of(head: str) -> pd.DataFrame:
        names = sorted((name for name in flown if name.startswith(head)), key=lambda name: int(name.split()[-1]))
        return pd.concat([flown[name] for name in names], ignore_index=True)

    return Found(all_of(ERRORS), closed_loop_costs.summary(all_of(COSTS)))


def shown(content: Content, numbers: Found, contents: dict[str, bytes]) -> Content:
    """The page's content with this section, whose files are added to the folder's contents."""
    enough = conclusions.good_enough(numbers.errors)
    tables = {"model_errors": numbers.errors, "model_costs": numbers.costs, "model_guide": enough}
    contents |= {f"{name}.csv": table.to_csv(index=False).encode() for name, table in tables.items()}
    pictures = []
    for index, (title, note, figure) in enumerate(_figures(numbers), start=1):
        images = style.images(figure)
        picture = Picture(f"M.{index}", title, "", note, images["svg"])
        contents |= {f"{picture.anchor}.{kind}": image for kind, image in images.items()}
        pictures.append(picture)
    guide = Table("model_guide", "Which model is good enough", GUIDE_TEXT, conclusions.guide(enough))
    lessons = conclusions.sentences(numbers.errors, numbers.costs)
    return replace(content, model_errors=pictures, lessons=lessons, guide=guide)


def _figures(numbers: Found) -> list[tuple[str, str, Figure]]:
    """Title, note and drawing of each figure."""
    errors, near_m = numbers.errors, conclusions.NEAR_M
    size = (
        "The leader is on a circle at 600 km and 60°. Dotted is what linearisation alone does; the distance from it is "
        "J2's. Where lines lie on each other, the models do not differ."
    )
    falling = "Without J2 the models' own assumptions remain: Yamanaka and Ankersen's is left with the linearisation."
    return [
        ("Model error against size, 1 orbit", _SAME + size, figures.against_size(errors, 1)),
        ("Model error against size, 10 orbits", _SAME + size, figures.against_size(errors, 10)),
        ("Model error against inclination", _SAME + _NEAR, figures.against_inclination(errors, near_m)),
        (
            "Model error against eccentricity",
            _SAME + _NEAR + "The perigee stays at 600 km. The mean reference is one of circles only.",
            figures.against_eccentricity(errors, near_m, j2=True),
        ),
        (
            "Model error against eccentricity, no J2",
            _SAME + _NEAR + falling,
            figures.against_eccentricity(errors, near_m, j2=False),
        ),
        (
            "Cost in closed loop, linear and nonlinear",
            "Means and 95 % intervals; right, of the differences on the same seeds. Gains are those of the scenario's "
            "file, keeping_eccentric's those of keeping. Filter and laws believe modified HCW, in keeping_eccentric "
            "Yamanaka and Ankersen's model, unless it says otherwise.",
            figures.costs(numbers.costs),
        ),
    ]
