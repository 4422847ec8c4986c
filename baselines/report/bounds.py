"""What was possible at all on each seed, for the report to hold the policies against."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from tqdm import tqdm

from baselines.fuel import fuel_optimal
from baselines.report.flights import Flown
from formation_env.dynamics import NONLINEAR
from formation_env.dynamics.base import Array
from formation_env.scenario import Scenario

SOLVER = "clarabel"
FOLDER = "bounds"
"""Where the plans are kept, inside the report's folder."""


def find_bounds(flown: Sequence[Flown], seeds: Sequence[int], out: Path) -> dict[str, Array]:
    """The least cost of each seed (seeds,), m/s, by environment; those with a nonlinear truth have none.

    Nothing is found where the solver is not installed.

    Args:
        flown: the environments.
        seeds: of their episodes.
        out: the report's folder; plans are kept in it, so that a second report need not solve them again.
    """
    linear = [item for item in flown if item.scenario.dynamics != NONLINEAR]
    if find_spec(SOLVER) is None:
        return {}
    with tqdm(total=len(linear) * len(seeds), desc="bounds", unit="episode", dynamic_ncols=True) as bar:
        return {item.label: _bounds(item.scenario, seeds, out / FOLDER, bar) for item in linear}


def _bounds(scenario: Scenario, seeds: Sequence[int], folder: Path, bar: "tqdm[None]") -> Array:
    costs = np.empty(len(seeds))
    for index, seed in enumerate(seeds):
        costs[index] = fuel_optimal(scenario, seed=seed, cache_folder=folder).cost
        bar.update()
    return costs
