"""Jobs whose tables are cached on disk, so that an interrupted run continues where it stopped."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import pandas as pd

from baselines.experiments.parallel import Job, Name, Progress
from baselines.result_cache import Arrays, Entry, entry, remove_temporaries

FOLDER: Final = "flown"
"""Folder of finished jobs, inside a report's folder."""


class TableJob(Job, Protocol):
    """A job that returns a table, or None if there was nothing to fly."""

    @property
    def key(self) -> Any:
        """Cache key (compared by repr): all settings that the table depends on; None disables caching."""
        ...

    def run(self, progress: Progress) -> pd.DataFrame | None:
        """Fly it; progress is called with the cost of what was flown since the last call."""
        ...


@dataclass(frozen=True)
class CachedJob:
    """A job whose table is read from the cache if it is there, and otherwise computed and stored.

    Attributes:
        job: computes the table.
        place: its file.
    """

    job: TableJob
    place: Entry

    @property
    def cost(self) -> int:
        """Duration without the cache, in steps of a batch."""
        return self.job.cost

    def run(self, progress: Progress) -> pd.DataFrame | None:
        """The job's table.

        Raises:
            OSError: the folder cannot be written.
        """
        table = read_table(self.place)
        if table is not None:
            progress(self.cost)
            return table
        table = self.job.run(progress)
        if table is not None:
            write_table(self.place, table)
        return table


def cached(jobs: Mapping[Name, TableJob], folder: Path | None) -> dict[Name, Job]:
    """Wrap jobs so that their tables are cached in a folder; jobs without a key run every time.

    Args:
        jobs: by name.
        folder: of the cache; None disables it.
    """
    if folder is None:
        return dict(jobs)
    remove_temporaries(folder)
    return {
        name: job if (place := place_of(folder, job)) is None else CachedJob(job, place) for name, job in jobs.items()
    }


def place_of(folder: Path, job: TableJob) -> Entry | None:
    """The cache entry of a job; None if it has no key."""
    return None if job.key is None else entry(folder, type(job).__name__.lower(), job.key)


def write_table(place: Entry, table: pd.DataFrame) -> None:
    """Store a table of numbers, flags and texts.

    Raises:
        OSError: the folder cannot be written.
    """
    columns: Arrays = {str(name): values.to_numpy() for name, values in table.items()}
    for name, values in columns.items():
        if values.dtype.kind not in "biuf":
            columns[name] = values.astype(str)  # pandas keeps texts as objects
    place.write(columns)


def read_table(place: Entry) -> pd.DataFrame | None:
    """A cached table; None if there is none."""
    columns = place.read()
    if columns is None or len({values.shape for values in columns.values()}) > 1:
        return None
    return pd.DataFrame(
        {name: values.tolist() if values.dtype.kind == "U" else values for name, values in columns.items()}
    )
