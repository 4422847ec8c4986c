"""The report's table of learned policies: what they cost, what they took, and how they stand to the classical ones."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from agents.policy.library import Card, Interval
from baselines.controllers.registry import POLICIES
from baselines.experiments.statistics import Results
from baselines.report.table import Table
from baselines.report.words import duration, numbers

LINEAR: Final = ("lqr", "lqr_finite", "lqr_quasi_static", "smc")
"""The LQR and sliding-mode policies that solve no cone program."""
YARDSTICK: Final = "mpc"
"""Whose time for an action stands beside the learned policies'."""
NONE: Final = "–"
COLUMNS: Final = (
    "environment",
    "policy",
    "cost, m/s",
    "over training seeds, m/s",
    "training seeds",
    "steps of each",
    "wall time of each, min",
    "learnt after pretraining, m/s",
    "cost over bound",
    "over best LQR or SMC",
    "over best classical",
    "an action takes",
    f"{YARDSTICK}'s takes",
)
NOTE: Final = (
    "In brackets 95 % intervals. Cost: of the shipped policy, which validation seeds chose among its training runs, on "
    "the test seeds of this report. Over training seeds: mean test cost of all its training runs, with Student's "
    "interval over them. Wall time: mean of the runs, pretraining + reinforcement learning. Learnt after pretraining: "
    "by how much reinforcement learning lowered the test cost of the actor that it started from, paired by seed. Over "
    "bound: seed by seed, as in the tables below. Over a classical policy: ratio of the mean costs on the seeds of "
    f"both, its interval paired by seed; the best is that of least mean cost, of {', '.join(LINEAR)}, or of all."
)


def learned_table(results: Sequence[Results], cards: Mapping[str, Sequence[Card]]) -> Table:
    """A line for each environment and learned policy that has a card.

    Args:
        results: what was flown.
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


def _row(results: Results, label: str, card: Card) -> tuple[str, ...]:
    return (
        results.flown.label,
        label,
        _text(results.cost(label)),
        _interval(card.cost_over_runs_m_s),
        str(len(card.runs)),
        f"{np.mean([run.steps for run in card.runs]):,.0f}",
        _minutes(card),
        _interval(card.runs[0].saved_m_s),
        _text(results.cost_ratios[label]) if results.cost_ratios else NONE,
        _over(results, label, LINEAR),
        _over(results, label, POLICIES),
        _time(results, label),
        _time(results, YARDSTICK),
    )


def _text(interval: tuple[float, float, float]) -> str:
    mean, low, high = numbers(interval)
    return mean if low == high else f"{mean} [{low}, {high}]"


def _interval(found: Interval | None) -> str:
    return NONE if found is None else _text((found.mean, found.low, found.high))


def _minutes(card: Card) -> str:
    """Of pretraining, a question mark where it is not known, and of what came then."""
    times = [run.pretraining_s for run in card.runs if run.pretraining_s is not None]
    before = f"{np.mean(times) / 60:.1f}" if len(times) == len(card.runs) else "?"
    return f"{before} + {np.mean([run.wall_time_s for run in card.runs]) / 60:.1f}"


def _over(results: Results, label: str, others: Iterable[str]) -> str:
    """Cost over that of the best of some classical policies, and which that is."""
    known = set(others)
    best = next((name for name in results.ranking if name in known), None)
    if best is None or not results.cost(best)[0] > 0:
        return NONE
    seeds = f", {results.count(best)} of {results.count(label)} seeds" if best in results.partial else ""
    return f"{_text(results.over(label, best))} ({best}{seeds})"


def _time(results: Results, policy: str) -> str:
    return duration(results.flown.action_time_us(policy)) if policy in results.flown.flights else NONE
