"""Tables of finished jobs on disk, so that what was interrupted goes on."""

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol
from zipfile import BadZipFile

import numpy as np
import pandas as pd

import formation_env
from baselines.experiments.parallel import Name, Progress, Work
from formation_env.files import replacing

FOLDER: Final = "flown"
"""Where finished flights are kept, inside the folder of a report."""


class Tabled(Work, Protocol):
    """A job that gives a table, or None if there was nothing to fly."""

    @property
    def key(self) -> Any:
        """All that the table depends on, told apart by `repr`; None if it cannot be told."""
        ...

    def fly(self, progress: Progress) -> pd.DataFrame | None:
        """Fly it; progress is called with the cost of what was flown since the last call."""
        ...


@dataclass(frozen=True)
class Kept:
    """A job whose table is read from a file if that is there, and else flown and written to it.

    Attributes:
        job: what is flown.
        path: the file, an archive of its columns.
    """

    job: Tabled
    path: Path

    @property
    def cost(self) -> int:
        """How long it takes if it is flown."""
        return self.job.cost

    def fly(self, progress: Progress) -> pd.DataFrame | None:
        """The job's table.

        Raises:
            OSError: the folder cannot be written.
        """
        table = read(self.path)
        if table is not None:
            progress(self.cost)
            return table
        table = self.job.fly(progress)
        if table is not None:
            write(self.path, table)
        return table


def keep(jobs: Mapping[Name, Tabled], folder: Path | None) -> dict[Name, Work]:
    """The same jobs, their tables kept in a folder; those that do not say what they depend on are flown every time.

    Args:
        jobs: by name.
        folder: where the files are; None keeps nothing.
    """
    if folder is None:
        return dict(jobs)
    return {name: job if job.key is None else Kept(job, path_of(folder, job)) for name, job in jobs.items()}


def path_of(folder: Path, job: Tabled) -> Path:
    """The file of a job; its name has the hash of all that its table depends on."""
    text = repr((formation_env.__version__, job.key))
    return folder / f"{type(job).__name__.lower()}_{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"


def write(path: Path, table: pd.DataFrame) -> None:
    """Keep a table of numbers, flags and texts; the file is complete or not there.

    Raises:
        OSError: the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = {str(name): values.to_numpy() for name, values in table.items()}
    for name, values in columns.items():
        if values.dtype.kind not in "biuf":
            columns[name] = values.astype(str)  # pandas keeps texts as objects, which numpy would pickle
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **columns)


def read(path: Path) -> pd.DataFrame | None:
    """A kept table; None if there is none, or the file is not a whole one."""
    try:
        # from memory: of a broken archive numpy leaves the file open
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            return pd.DataFrame(dict(arrays))
    except (OSError, ValueError, KeyError, EOFError, TypeError, BadZipFile):
        return None
