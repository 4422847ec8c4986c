"""What was possible at all on each seed, for the report to hold the policies against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from baselines.experiments.parallel import Progress
from baselines.optimal import fuel_optimal
from baselines.optimal.cone_solver import SOLVER
from formation_env.dynamics import NONLINEAR
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

FOLDER: Final = "bounds"
"""Where the plans are kept, inside the report's folder."""
_CHUNK: Final = 10
"""Seeds of one job."""
_SOLVE_COST: Final = 2
"""Time of one seed's solution, per step of the episode, in steps of a batch."""


@dataclass(frozen=True)
class Bounds:
    """The least costs of some seeds; a `Work` of `baselines.experiments.parallel`.

    Attributes:
        scenario: the environment, with a linear truth.
        seeds: of its episodes.
        folder: where plans are kept, so that a second report need not solve them again.
    """

    scenario: Scenario
    seeds: tuple[int, ...]
    folder: Path

    @property
    def cost(self) -> int:
        """How long it takes, in steps of a batch."""
        return self.scenario.num_steps * _SOLVE_COST * len(self.seeds)

    def fly(self, progress: Progress) -> Array:
        """The least cost of each seed (seeds,), m/s."""
        costs = np.empty(len(self.seeds))
        for index, seed in enumerate(self.seeds):
            costs[index] = fuel_optimal(self.scenario, seed=seed, cache_folder=self.folder).cost
            progress(self.cost // len(self.seeds))
        return costs


def bound_jobs(scenarios: Mapping[str, Scenario], seeds: Sequence[int], out: Path) -> dict[tuple[str, int], Bounds]:
    """What is solved, by environment and first seed.

    There is none for a nonlinear truth, and none at all where the solver is not installed.

    Args:
        scenarios: label -> environment.
        seeds: of their episodes.
        out: the report's folder.
    """
    linear = {env: scenario for env, scenario in scenarios.items() if scenario.dynamics != NONLINEAR}
    if find_spec(SOLVER) is None:
        return {}
    chunks = [tuple(seeds)[start : start + _CHUNK] for start in range(0, len(seeds), _CHUNK)]
    return {
        (env, chunk[0]): Bounds(scenario, chunk, out / FOLDER) for env, scenario in linear.items() for chunk in chunks
    }
