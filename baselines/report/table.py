"""Further tables of the report, which its caller makes of the results: on the page, as Markdown and as numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from baselines.experiments.estimates import Interval
from baselines.experiments.statistics import Results
from baselines.report.text import numbers

NONE = "–"


@dataclass(frozen=True)
class Quantity:
    """A cell with a mean and its interval.

    Attributes:
        interval: mean, low and high.
        episodes: number of values behind the mean; None if it is not known.
        note: stands behind the number.
    """

    interval: Interval
    episodes: int | None = None
    note: str = ""

    def __str__(self) -> str:
        mean, low, high = numbers(self.interval)
        text = mean if low == high else f"{mean} [{low}, {high}]"
        return f"{text} ({self.note})" if self.note else text

    def as_data(self) -> dict[str, Any]:
        """Numbers by name."""
        mean, low, high = self.interval
        return {"mean": mean, "low": low, "high": high, "n": self.episodes} | ({"note": self.note} if self.note else {})


Cell = str | float | int | Quantity | None
"""Text, a number, a mean with its interval, or nothing."""


@dataclass(frozen=True)
class Table:
    """A table of the report.

    Attributes:
        name: of its file, NAME.md.
        title: above it.
        columns: headings, with units.
        rows: cells, as many as columns.
        note: explains the columns.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str

    def texts(self) -> list[list[str]]:
        """The cells as text."""
        return [[_text(cell) for cell in row] for row in self.rows]

    def markdown(self) -> str:
        """The table as Markdown, with the note below."""
        lines = [list(self.columns), ["---"] * len(self.columns), *self.texts()]
        return "\n".join([*(markdown_row(line) for line in lines), "", self.note]) + "\n"

    def as_data(self) -> dict[str, Any]:
        """The table as plain data: one mapping per row, numbers as numbers."""
        plain = [[cell.as_data() if isinstance(cell, Quantity) else cell for cell in row] for row in self.rows]
        rows = [dict(zip(self.columns, row, strict=True)) for row in plain]
        return {"name": self.name, "title": self.title, "columns": self.columns, "rows": rows, "note": self.note}


def _text(cell: Cell) -> str:
    if cell is None:
        return NONE
    return f"{cell:,}" if isinstance(cell, int) else f"{cell:,.6g}" if isinstance(cell, float) else str(cell)


def markdown_row(cells: Sequence[str]) -> str:
    """A row of a Markdown table; a bar or a line break in a cell does not split it."""
    return f"| {' | '.join(' '.join(cell.split()).replace('|', chr(92) + '|') for cell in cells)} |"


Tables = Callable[[Sequence[Results]], Sequence[Table]]
"""Makes tables of the results of all environments."""


def no_tables(results: Sequence[Results]) -> Sequence[Table]:
    """No further tables."""
    return ()
