"""Solutions on disk: one file for each episode and each choice of settings."""

import hashlib
import io
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike

import formation_env
from baselines.optimal.cone_program import Solution
from formation_env.files import replacing
from formation_env.task.scenario import Scenario


def path_of(
    folder: Path, scenario: Scenario, seed: int | None, initial_state: ArrayLike | None, exact_arrival: bool
) -> Path:
    """The file of an episode; its name has the hash of all that the episode depends on."""
    start = None if initial_state is None else np.asarray(initial_state, float).tolist()
    settings = repr((formation_env.__version__, scenario, seed, start, exact_arrival))
    label = "certain" if seed is None else f"seed{seed}"
    return folder / f"optimal_{label}_{hashlib.sha256(settings.encode()).hexdigest()[:16]}.npz"


def write(path: Path, solution: Solution) -> None:
    """Keep a solution; the file is complete or not there.

    Raises:
        OSError: the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        np.savez_compressed(temporary, controls=solution.controls, multipliers=solution.multipliers)


def read(path: Path, steps: int) -> Solution | None:
    """The solution of an episode of that many steps; None if there is none, or the file is not a whole one."""
    try:
        # from memory: of a broken archive numpy leaves the file open
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            solution = Solution(arrays["controls"], arrays["multipliers"])
    except (OSError, ValueError, KeyError, EOFError, TypeError, BadZipFile):
        return None
    parts, shapes = (solution.controls, solution.multipliers), ((steps, 3), (steps + 1, 6))
    whole = all(
        part.shape == shape and part.dtype == np.float64 and np.isfinite(part).all()
        for part, shape in zip(parts, shapes, strict=True)
    )
    return solution if whole else None
