"""Metrics of an episode. To add one: a formula here, and a line in `METRICS`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.simulation import ALL_ROWS, Rows, Simulation
from formation_env.numerics.arrays import Array
from formation_env.task.schedule import OFFSETS


@dataclass(frozen=True)
class EpisodeTotals:
    """Totals of episodes, each (rows,).

    All errors follow one rule: an early end counts the instants left as flown at the distance limit (or at the last
    error, if that is greater).

    Attributes:
        steps: steps flown.
        reward: sum of rewards, m/s.
        delta_v_m_s: sum of delta-v.
        error_m: sum of position errors over the hold.
        square_m2: sum of squared position errors over the hold.
        max_error_m: greatest position error of the hold.
        arrival_error_m: mean position error at the ends of the transfers.
        final_error_m: position error at the end of the plan.
        tolerated: steps of the hold within the tolerance.
        lost: measurements not received.
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


@dataclass(frozen=True)
class Metric:
    """A number per episode, and how tables show it.

    Attributes:
        name: column of `evaluate`'s table, key of `info["episode_totals"]`; it ends in the SI unit, if there is one.
        heading: name in tables for people.
        unit: unit in tables for people.
        better: which values are better; None if neither is.
        formula: from totals to values (rows,).
        factor: from the value to the number in tables for people; negative for a cost that the table calls a return.
    """

    name: str
    heading: str
    unit: str
    better: Literal["lower", "higher"] | None
    formula: Callable[[EpisodeTotals], Array]
    factor: float = 1.0


def _return(totals: EpisodeTotals) -> Array:
    """Sum of rewards: minus (delta-v + weight * mean error), m/s."""
    return totals.reward


def _mean_error(totals: EpisodeTotals) -> Array:
    """Mean position error over the hold, m."""
    return totals.error_m / totals.hold_steps


def _rms_error(totals: EpisodeTotals) -> Array:
    """Root-mean-square position error over the hold, m."""
    return np.sqrt(totals.square_m2 / totals.hold_steps)


def _in_tolerance(totals: EpisodeTotals) -> Array:
    """Share of the hold within the scenario's tolerance."""
    return totals.tolerated / totals.hold_steps


def _lost(totals: EpisodeTotals) -> Array:
    """Share of measurements not received, the one at the start included."""
    return totals.lost / (totals.steps + 1)


_METRICS: Final = (
    Metric("return", "cost", "m/s", "higher", _return, factor=-1.0),
    Metric("delta_v_m_s", "Δv", "m/s", "lower", lambda totals: totals.delta_v_m_s),
    Metric("position_error_mean_m", "mean error", "m", "lower", _mean_error),
    Metric("position_error_rms_m", "rms error", "m", "lower", _rms_error),
    Metric("position_error_max_m", "max error", "m", "lower", lambda totals: totals.max_error_m),
    # mean over several transfers; at the start if there is none
    Metric("position_error_arrival_m", "arrival error", "m", "lower", lambda totals: totals.arrival_error_m),
    Metric("position_error_final_m", "final error", "m", "lower", lambda totals: totals.final_error_m),
    Metric("in_tolerance", "in tolerance", "% of hold", "higher", _in_tolerance, factor=100.0),
    Metric("measurements_lost", "data lost", "%", None, _lost, factor=100.0),
    Metric("steps", "steps", "", None, lambda totals: totals.steps),
)
METRICS: Final = {metric.name: metric for metric in _METRICS}
"""All metrics, by name."""
SAFETY_METRICS: Final = ("cost", "least_distance_m")
"""Sum of the costs, and least distance from any other spacecraft."""


def episode_metrics(simulation: Simulation, rows: Rows = ALL_ROWS) -> dict[str, Array]:
    """Metrics of the episodes of some rows up to now, each (rows,); those of safety if the scenario limits anything."""
    totals = simulation.totals(rows)
    variant = totals["variant"].astype(np.intp)
    episodes = EpisodeTotals(
        steps=totals["step"],
        reward=totals["sum_reward"],
        delta_v_m_s=totals["sum_delta_v"],
        error_m=totals["sum_error"],
        square_m2=totals["sum_square_error"],
        max_error_m=totals["max_error"],
        arrival_error_m=totals["arrival_error"],
        final_error_m=_final_error(simulation, rows, totals["step"], variant),
        tolerated=totals["tolerated"],
        lost=totals["lost"],
        hold_steps=simulation.schedule[variant, 0, OFFSETS["counts_left"]],
    )
    metrics = {name: metric.formula(episodes) for name, metric in METRICS.items()}
    if simulation.guarded:
        metrics |= dict(zip(SAFETY_METRICS, simulation.safety_totals[:, rows], strict=True))
    return metrics


def _final_error(simulation: Simulation, rows: Rows, steps: Array, variant: NDArray[np.intp]) -> Array:
    """Position error at the end of the plan (rows,); an early end counts as staying at the distance limit."""
    error, terminated = simulation.results["position_error"][rows], simulation.results["terminated"][rows]
    num_steps, limit_m = simulation.plan_limits[variant].T
    return np.where(terminated & (steps < num_steps), np.maximum(error, limit_m), error)
