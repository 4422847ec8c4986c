"""The HTML page of the reproduction: one file that needs no network."""

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import jinja2

from baselines.thesis.claim import Claim, Verdict


@dataclass(frozen=True)
class Picture:
    """A figure as it stands on the page.

    Attributes:
        number: of the figure in the thesis; empty if it is not in it.
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


def render(
    pictures: Sequence[Picture], claims: Sequence[Claim], model_errors: Sequence[Picture], facts: dict[str, Any]
) -> str:
    """The page.

    Args:
        pictures: figures of the thesis, in order.
        claims: lines of the claims table; without any, there is no such section.
        model_errors: figures of what the linear world hides; without any, there is no such section.
        facts: what is said of the making: `command`, `episodes`, `step_s`, `versions`.
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("baselines.thesis"), jinja2.PackageLoader("baselines.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    counts = Counter(claim.verdict for claim in claims)
    return environment.get_template("thesis.html.jinja").render(
        pictures=pictures,
        claims=claims,
        verdicts=[(verdict, counts[verdict]) for verdict in get_args(Verdict)],
        model_errors=model_errors,
        facts=facts,
    )
