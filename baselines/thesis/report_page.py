"""The HTML page of the reproduction: one file that needs no network."""

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import jinja2
import numpy as np
import pandas as pd

from baselines.report.words import number
from baselines.thesis.claims.claim import Claim, Verdict


@dataclass(frozen=True)
class Picture:
    """A figure as it stands on the page.

    Attributes:
        number: of the figure in the thesis, or one of its own, M.1 and so on; empty if it has none.
        title: what it shows.
        sentence: of the thesis, beside the figure; empty if there is none.
        note: what came out.
        svg: the figure.
    """

    number: str
    title: str
    sentence: str
    note: str
    svg: bytes

    @property
    def anchor(self) -> str:
        """Name of its place on the page, and of its files."""
        return f"figure-{self.number}".replace(".", "-")

    @property
    def uri(self) -> str:
        """The figure itself as an address."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.svg).decode()


@dataclass(frozen=True)
class Table:
    """A table as it stands on the page.

    Attributes:
        name: of its file.
        title: its heading.
        text: what it shows.
        data: its lines.
    """

    name: str
    title: str
    text: str
    data: pd.DataFrame

    @property
    def rows(self) -> list[list[str]]:
        """Its lines in words."""
        return [[_words(value) for value in line] for line in self.data.itertuples(index=False)]


def _words(value: Any) -> str:
    """A cell: numbers to three digits, yes and no, nothing for what is missing."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, float, np.number)):
        return number(float(value))
    return "" if value is None else str(value)


@dataclass(frozen=True)
class Content:
    """What stands on the page; a section without content is left out.

    Attributes:
        pictures: figures of the thesis, in order.
        claims: lines of the claims table.
        tables: what stands below the claims.
        model_errors: figures of what the linear world hides.
        lessons: sentences above them.
        guide: which model is good enough; stands below the sentences.
    """

    pictures: Sequence[Picture]
    claims: Sequence[Claim] = ()
    tables: Sequence[Table] = ()
    model_errors: Sequence[Picture] = ()
    lessons: Sequence[str] = ()
    guide: Table | None = None


def render(content: Content, facts: dict[str, Any]) -> str:
    """The page.

    Args:
        content: what stands on it.
        facts: what is said of the making: `command`, `episodes`, `step_s`, `versions`.
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("baselines.thesis"), jinja2.PackageLoader("baselines.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    counts = Counter(claim.verdict for claim in content.claims)
    return environment.get_template("thesis.html.jinja").render(
        pictures=content.pictures,
        claims=content.claims,
        tables=content.tables,
        model_errors=content.model_errors,
        lessons=content.lessons,
        guide=content.guide,
        verdicts=[(verdict, counts[verdict]) for verdict in get_args(Verdict)],
        facts=facts,
    )
