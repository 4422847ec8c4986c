"""Perfect-information bound of each seed, as jobs for `experiments.parallel`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from baselines.experiments.parallel import Progress
from baselines.optimal import fuel_optimal
from baselines.optimal.cone_solver import SOLVER
from baselines.result_cache import remove_temporaries
from formation_env.dynamics import NONLINEAR
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

FOLDER: Final = "bounds"
"""Folder of the cached plans, inside the report's folder."""
LABEL: Final = "perfect-information bound"
"""Stands for a policy in the names of jobs."""
_CHUNK: Final = 10
"""Seeds of one job."""
_SOLVE_COST: Final = 2
"""Time to solve one seed, per step of the episode, in steps of a batch."""


@dataclass(frozen=True)
class Bounds:
    """Perfect-information bounds of some seeds; a `Job` of `baselines.experiments.parallel`.

    Attributes:
        scenario: the environment, with a linear truth.
        seeds: of its episodes.
        folder: cache of the plans, so that a second report does not solve them again.
    """

    scenario: Scenario
    seeds: tuple[int, ...]
    folder: Path

    @property
    def cost(self) -> int:
        """Estimated duration, in steps of a batch."""
        return self.scenario.num_steps * _SOLVE_COST * len(self.seeds)

    def run(self, progress: Progress) -> Array:
        """The bound of each seed (seeds,), m/s."""
        costs = np.empty(len(self.seeds))
        for index, seed in enumerate(self.seeds):
            costs[index] = fuel_optimal(self.scenario, seed=seed, cache_folder=self.folder).cost
            progress(self.cost // len(self.seeds))
        return costs


def bound_jobs(
    scenarios: Mapping[str, Scenario], seeds: Sequence[int], out: Path
) -> dict[tuple[str, str, int], Bounds]:
    """Bound jobs, by environment and first seed.

    A nonlinear truth has no bound; without the solver there are no jobs.

    Args:
        scenarios: label -> environment.
        seeds: of their episodes.
        out: the report's folder.
    """
    linear = {env: scenario for env, scenario in scenarios.items() if scenario.dynamics != NONLINEAR}
    if find_spec(SOLVER) is None:
        return {}
    chunks = [tuple(seeds)[start : start + _CHUNK] for start in range(0, len(seeds), _CHUNK)]
    remove_temporaries(out / FOLDER)
    return {
        (env, LABEL, chunk[0]): Bounds(scenario, chunk, out / FOLDER)
        for env, scenario in linear.items()
        for chunk in chunks
    }
