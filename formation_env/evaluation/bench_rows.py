"""Cost of a row of a batched environment: its time against the number of rows, and its memory."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from formation_env.evaluation.bench import REFERENCE, batch_stepper, rates
from formation_env.files import replacing
from formation_env.kernel.simulation import Simulation
from formation_env.task.scenario import Scenario

ROWS: Final = (1, 16, 64, 256, 1024, 4096, 16_384, 65_536, 262_144, 1_000_000)
"""Batches that are measured."""
_ROW_STEPS: Final = 500_000
"""Steps of all rows together in one timed call, roughly."""
_MOST_STEPS: Final = 2000
_FEWEST_STEPS: Final = 3
_LARGE: Final = 65_536
"""From so many rows on, a batch is timed fewer times."""
_ROUNDS, _ROUNDS_OF_LARGE = 3, 2


def time_per_row(env: str, rows: Sequence[int] = ROWS, row_steps: int = _ROW_STEPS) -> pd.DataFrame:
    """Time per row and step in batches of different sizes, ours and CartPole's in turns.

    The few steps of a large batch come soon after its first reset, when hardly an episode ends.

    Args:
        env: a registered id, or a scenario's name or path.
        rows: sizes of the batches.
        row_steps: steps of all rows together in one timed call; large batches fly 3 steps at least.

    Returns:
        Columns: rows, env_ns, cartpole_ns.
    """
    lines = []
    for size in rows:
        steps = min(max(math.ceil(row_steps / size), _FEWEST_STEPS), _MOST_STEPS)
        steppers = {name: batch_stepper(name, size, steps) for name in (env, REFERENCE)}
        best = rates(steppers, _ROUNDS if size < _LARGE else _ROUNDS_OF_LARGE)
        lines.append((size, *(1e9 / rate for rate in best.values())))
    return pd.DataFrame(lines, columns=["rows", "env_ns", "cartpole_ns"])


def plot_time_per_row(times: pd.DataFrame, env: str, path: Path) -> None:
    """Draw a table of `time_per_row` as a PNG file, both axes logarithmic.

    Raises:
        OSError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.loglog(times["rows"], times["env_ns"], "o-", color="#0072b2", label=env)
    axes.loglog(times["rows"], times["cartpole_ns"], "s--", color="#d55e00", label=f"{REFERENCE}, batched")
    axes.set(xlabel="rows of the batch", ylabel="time per row and step, ns")
    axes.grid(which="major", alpha=0.3)
    axes.legend()
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


def bytes_per_row(scenario: Scenario, rows: int) -> pd.DataFrame:
    """Memory of the arrays that grow with the batch, by what they hold; results and observations are of one step.

    The last tile is whole even if rows do not fill it, so that small batches have more per row.

    Args:
        scenario: the scenario.
        rows: rows of the batch.

    Returns:
        Columns: what, bytes_per_row; the last line is the total.
    """
    simulation = Simulation(scenario, rows)
    held = {
        "state": simulation._states.nbytes,
        "random streams": simulation._streams.nbytes,
        "keys": simulation._keys.nbytes,
        "actions": simulation.actions.nbytes,
        "results": int(np.sum([block.nbytes for block in simulation.results.blocks])),
        "observations": simulation.new_observations().nbytes,
    }
    held["total"] = sum(held.values())
    return pd.DataFrame([(name, size / rows) for name, size in held.items()], columns=["what", "bytes_per_row"])
