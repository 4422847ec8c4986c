"""Further tables of the report, which its caller makes of the results: on the page, and as Markdown beside it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from baselines.experiments.statistics import Results


@dataclass(frozen=True)
class Table:
    """A table in words and numbers for people.

    Attributes:
        name: of its file, NAME.md.
        title: above it.
        columns: headings, with units.
        rows: cells, as many as columns.
        note: what the columns mean.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str

    def markdown(self) -> str:
        """The same as Markdown, with the note below."""
        lines = (self.columns, ("---",) * len(self.columns), *self.rows)
        return "\n".join([*(f"| {' | '.join(line)} |" for line in lines), "", self.note]) + "\n"


Tables = Callable[[Sequence[Results]], Sequence[Table]]
"""Makes tables of the results of all environments."""


def no_tables(results: Sequence[Results]) -> Sequence[Table]:
    """None."""
    return ()
