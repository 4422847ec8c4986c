"""A statement of the thesis and its verdict."""

from dataclasses import dataclass
from typing import Literal, get_args

Verdict = Literal["holds", "fails", "cannot be decided"]


@dataclass(frozen=True)
class Claim:
    """One line of the claims table.

    Attributes:
        section: of the thesis, such as `5.2.1`.
        sentence: what it says, in its own words.
        thesis_value: the number or comparison it gives, with its unit.
        ours: the same from this project, with its unit and its 95 % interval.
        low: the interval's low end, None if there is none.
        high: the interval's high end, None if there is none.
        verdict: what became of it.
        assumption: what the verdict rests on: sampling, noise, reading of the settings.
        explanation: why, in a sentence or two.
    """

    section: str
    sentence: str
    thesis_value: str
    ours: str
    low: float | None
    high: float | None
    verdict: Verdict
    assumption: str
    explanation: str

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Verdict):
            raise ValueError(f"claim {self.section}: verdict must be one of {get_args(Verdict)}, got {self.verdict!r}")
