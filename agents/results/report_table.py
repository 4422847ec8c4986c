"""The report's table of learned policies: cost, training effort, and comparison with the classical policies."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from agents.policy.library import Card, Interval
from baselines.controllers.registry import POLICIES
from baselines.experiments.statistics import Results
from baselines.report.table import Cell, Quantity, Table

LINEAR: Final = ("lqr", "lqr_finite", "lqr_quasi_static", "smc")
"""The LQR and sliding-mode policies that solve no cone program."""
MPC: Final = "mpc"
"""Policy whose time per action stands beside the learned policies'."""
COLUMNS: Final = (
    "environment",
    "policy",
    "cost, m/s",
    "mean over training seeds, m/s",
    "training seeds",
    "steps per run",
    "pretraining per run, min",
    "RL per run, min",
    "gain from RL, m/s",
    "cost over bound",
    "over best LQR or SMC",
    "over best classical",
    "time per action, µs",
    f"time per action of {MPC}, µs",
)
NOTE: Final = (
    "In brackets 95 % intervals. Cost: of the shipped policy, chosen among its training runs on the validation seeds, "
    "on the test seeds of this report. Mean over training seeds: mean test cost of all its training runs, with "
    "Student's interval over them. Gain from RL: how much reinforcement learning lowered the test cost of the "
    "pretrained actor, paired by seed. Over bound: mean of each seed's cost over its bound. Over a classical policy: "
    "ratio of the mean costs on the seeds of both, with an interval paired by seed; the best one has the lowest mean "
    f"cost, of {', '.join(LINEAR)}, or of all."
)


def learned_table(results: Sequence[Results], cards: Mapping[str, Sequence[Card]]) -> Table:
    """A row for each environment and learned policy that has a card.

    Args:
        results: of the environments.
        cards: label of a learned policy -> its cards, one for each scenario.
    """
    rows = [
        _row(item, label, card)
        for item in results
        for label, known in cards.items()
        for card in known
        if card.scenario == item.flown.scenario
    ]
    return Table("learned", "Learned policies: cost, training and compute", COLUMNS, tuple(rows), NOTE)


def _row(results: Results, label: str, card: Card) -> tuple[Cell, ...]:
    ratio = results.cost_ratios_flown.get(label)
    return (
        results.flown.label,
        label,
        Quantity(results.cost_flown(label), results.count(label)),
        _quantity(card.cost_over_runs_m_s, len(card.runs)),
        len(card.runs),
        round(float(np.mean([run.steps for run in card.runs]))),
        _pretraining_min(card),
        _minutes([run.wall_time_s for run in card.runs]),
        _quantity(card.runs[0].saved_m_s, card.test_episodes),
        None if ratio is None else Quantity(ratio, results.count(label)),
        _over(results, label, LINEAR),
        _over(results, label, POLICIES),
        _time_us(results, label),
        _time_us(results, MPC),
    )


def _quantity(interval: Interval | None, count: int) -> Quantity | None:
    return None if interval is None else Quantity((interval.mean, interval.low, interval.high), count)


def _pretraining_min(card: Card) -> float | None:
    """Mean pretraining time, minutes; None if a run does not know it."""
    times = [run.pretraining_s for run in card.runs if run.pretraining_s is not None]
    return _minutes(times) if len(times) == len(card.runs) else None


def _minutes(times_s: Sequence[float]) -> float:
    return round(float(np.mean(times_s)) / 60, 1)


def _over(results: Results, label: str, others: Iterable[str]) -> Quantity | None:
    """Cost over that of the best of some classical policies, and the name of that policy."""
    known = set(others)
    best = next((name for name in results.ranking if name in known), None)
    if best is None or not results.cost(best)[0] > 0:
        return None
    common = results.common(label, best)
    seeds = f", {common} of {results.count(label)} seeds" if best in results.partial else ""
    return Quantity(results.over(label, best), common, f"{best}{seeds}")


def _time_us(results: Results, policy: str) -> float | None:
    """Median time per action with two significant digits, microseconds."""
    return float(f"{results.flown.action_time_us(policy):.2g}") if policy in results.flown.flights else None
