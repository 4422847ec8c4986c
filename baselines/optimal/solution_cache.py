"""Solutions of the perfect-information program in the result cache: one file per episode and choice of settings."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from baselines.optimal.cone_program import Solution
from baselines.result_cache import Entry, entry
from formation_env.task.scenario import Scenario


def solution_entry(
    folder: Path, scenario: Scenario, seed: int | None, initial_state: ArrayLike | None, exact_arrival: bool
) -> Entry:
    """The cache entry of an episode's solution."""
    start = None if initial_state is None else np.asarray(initial_state, float).tolist()
    label = "optimal_nominal" if seed is None else f"optimal_seed{seed}"
    return entry(folder, label, (scenario, seed, start, exact_arrival))


def write(place: Entry, solution: Solution) -> None:
    """Store a solution.

    Raises:
        OSError: the folder cannot be written.
    """
    place.write({"controls": solution.controls, "multipliers": solution.multipliers})


def read(place: Entry, steps: int) -> Solution | None:
    """The cached solution of an episode of that many steps; None if there is none that is whole and finite."""
    arrays = place.read() or {}
    shapes = {"controls": (steps, 3), "multipliers": (steps + 1, 6)}
    whole = arrays.keys() == shapes.keys() and all(
        arrays[name].shape == shape and arrays[name].dtype == np.float64 and np.isfinite(arrays[name]).all()
        for name, shape in shapes.items()
    )
    return Solution(**arrays) if whole else None
