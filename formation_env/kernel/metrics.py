"""What is said of an episode once it has ended. To add a metric: a function here, and a line in `METRICS`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.simulation import Rows, Simulation
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES
from formation_env.task.schedule import OFFSETS


@dataclass(frozen=True)
class Sums:
    """What the kernel has added up over episodes, each (rows,).

    Attributes:
        steps: steps flown.
        reward: sum of rewards, m/s.
        delta_v_m_s: sum of delta-v.
        error_m: sum of position errors over the steps of the hold.
        square_m2: sum of their squares.
        max_error_m: greatest of them.
        arrival_error_m: mean error at the ends of the transfers.
        final_error_m: error at the last step.
        tolerated: steps of the hold within the tolerance.
        lost: measurements that did not arrive.
        hold_steps: steps of the whole hold.
    """

    steps: Array
    reward: Array
    delta_v_m_s: Array
    error_m: Array
    square_m2: Array
    max_error_m: Array
    arrival_error_m: Array
    final_error_m: Array
    tolerated: Array
    lost: Array
    hold_steps: Array


def _return(sums: Sums) -> Array:
    """Sum of rewards: minus (delta-v + weight * mean error), m/s."""
    return sums.reward


def _delta_v(sums: Sums) -> Array:
    """Delta-v of the episode, m/s."""
    return sums.delta_v_m_s


def _mean_error(sums: Sums) -> Array:
    """Mean position error over the hold, m; what an early end cut off counts as flown at the distance limit."""
    return sums.error_m / sums.hold_steps


def _rms_error(sums: Sums) -> Array:
    """Root mean square of the same."""
    return np.sqrt(sums.square_m2 / sums.hold_steps)


def _max_error(sums: Sums) -> Array:
    """Greatest of the same."""
    return sums.max_error_m


def _arrival_error(sums: Sums) -> Array:
    """Position error at the end of the transfer, m; the mean if there are several, at the start if there is none.

    What an early end cut off counts as at the distance limit.
    """
    return sums.arrival_error_m


def _final_error(sums: Sums) -> Array:
    """Position error at the last step, m."""
    return sums.final_error_m


def _tolerated(sums: Sums) -> Array:
    """Share of the hold within the scenario's tolerance."""
    return sums.tolerated / sums.hold_steps


def _lost(sums: Sums) -> Array:
    """Share of measurements that did not arrive, the one at the start included."""
    return sums.lost / (sums.steps + 1)


def _steps(sums: Sums) -> Array:
    """Steps flown."""
    return sums.steps


METRICS: Final[dict[str, Callable[[Sums], Array]]] = {
    "return": _return,
    "delta_v_m_s": _delta_v,
    "position_error_mean_m": _mean_error,
    "position_error_rms_m": _rms_error,
    "position_error_max_m": _max_error,
    "position_error_arrival_m": _arrival_error,
    "position_error_final_m": _final_error,
    "in_tolerance": _tolerated,
    "measurements_lost": _lost,
    "steps": _steps,
}


def episode_metrics(simulation: Simulation, rows: Rows = slice(None)) -> dict[str, Array]:
    """Metrics of the episodes of some rows up to now, each (rows,)."""
    totals: Array = simulation.state(field.FIRST_TOTAL, field.NUM_TOTALS, rows).T

    def total(offset: int) -> Array:
        column: Array = totals[(offset - field.FIRST_TOTAL) // LANES]
        return column

    sums = Sums(
        steps=simulation.state(field.STEP, 1, rows)[:, 0],
        reward=total(field.SUM_REWARD),
        delta_v_m_s=total(field.SUM_DELTA_V),
        error_m=total(field.SUM_ERROR),
        square_m2=total(field.SUM_SQUARE),
        max_error_m=total(field.MAX_ERROR),
        arrival_error_m=total(field.ARRIVAL_ERROR),
        final_error_m=simulation.result(field.POSITION_ERROR, rows).copy(),
        tolerated=total(field.TOLERATED),
        lost=total(field.LOST),
        hold_steps=simulation.schedule[simulation.variant(rows), 0, OFFSETS["counts_left"]],
    )
    return {name: metric(sums) for name, metric in METRICS.items()}
