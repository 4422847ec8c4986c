"""The HTML page of the reproduction: one file that needs no network."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import jinja2
import numpy as np
import pandas as pd

from baselines.report.text import number
from baselines.thesis.claims.claim import Claim, Verdict


@dataclass(frozen=True)
class Picture:
    """A figure of the page.

    Attributes:
        number: of the figure in the thesis, or M.1, M.2, ... for figures of this project; empty if it has none.
        title: what it shows.
        sentence: of the thesis, beside the figure; empty if there is none.
        note: the outcome.
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
class PageTable:
    """A table of the page.

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
        """Its cells as text."""
        return [[_text(value) for value in line] for line in self.data.itertuples(index=False)]


def _text(value: Any) -> str:
    """Text of a cell: numbers to three digits, yes or no, empty if missing."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, float, np.number)):
        return number(float(value))
    return "" if value is None else str(value)


@dataclass(frozen=True)
class Content:
    """Contents of the page; a section without content is left out.

    Attributes:
        pictures: figures of the thesis, in order.
        claims: lines of the claims table.
        tables: tables below the claims.
        model_errors: figures of what the linear models neglect.
        model_sentences: sentences above them.
        guide: table of the models' ranges of validity, below the sentences.
    """

    pictures: Sequence[Picture]
    claims: Sequence[Claim] = ()
    tables: Sequence[PageTable] = ()
    model_errors: Sequence[Picture] = ()
    model_sentences: Sequence[str] = ()
    guide: PageTable | None = None


def verdict_summary(claims: Sequence[Claim]) -> list[tuple[str, list[int]]]:
    """Number of claims per verdict: one line per section of the thesis in order, then the total."""
    lines = {"all": [claim.verdict for claim in claims]}
    lines = {section: [c.verdict for c in claims if c.section == section] for section in _sections(claims)} | lines
    return [(name, [verdicts.count(verdict) for verdict in get_args(Verdict)]) for name, verdicts in lines.items()]


def _sections(claims: Sequence[Claim]) -> list[str]:
    """Sections of the thesis that have claims, in order."""
    return sorted({claim.section for claim in claims})


def render(content: Content, facts: dict[str, Any]) -> str:
    """Render the page.

    Args:
        content: its sections.
        facts: of this run: `command`, `episodes`, `step_s`, `step_warning` (empty if there is none), `versions`.
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("baselines.thesis"), jinja2.PackageLoader("baselines.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("thesis.html.jinja").render(
        pictures=content.pictures,
        claims=content.claims,
        tables=content.tables,
        model_errors=content.model_errors,
        model_sentences=content.model_sentences,
        guide=content.guide,
        verdicts=get_args(Verdict),
        summary=verdict_summary(content.claims),
        facts=facts,
    )
