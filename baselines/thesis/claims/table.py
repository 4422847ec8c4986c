"""The claims table: every number and comparison that chapters 5 and 6 state, and what became of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from baselines.thesis import plan
from baselines.thesis.claims import (
    conclusions,
    failure,
    initialization,
    keeping,
    maneuver,
    noise_grid,
    readings,
    smc,
    tuned_comparison,
)
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.flights import Effort, keeper_decks, keepers
from baselines.thesis.claims.tuned_comparison import Comparison
from baselines.thesis.jobs import Job

_PARTS: Final[dict[str, Callable[[Effort], Mapping[str, Job | Comparison]]]] = {
    "keepers": keepers,
    "sweep": lambda effort: {"sweep": keeping.sweep(effort.coarse)},
    "maneuvers": maneuver.jobs,
    "grid": noise_grid.jobs,
    "readings": readings.jobs,
    "fair": tuned_comparison.jobs,
}


@dataclass(frozen=True)
class Tables:
    """What is said of the thesis's claims.

    Attributes:
        claims: the table, in the thesis's order.
        noise: the same sentences at each noise level.
        readings: which reading of the settings gives the figures.
        fair: LQR and SMC, tuned alike.
    """

    claims: list[Claim]
    noise: pd.DataFrame
    readings: pd.DataFrame
    fair: pd.DataFrame


def jobs(effort: Effort) -> dict[str, Job | Comparison]:
    """All flights that the claims need, by name, for `jobs.run`."""
    found: dict[str, Job | Comparison] = dict(plan.initializations(effort.dt_s))
    for part, make in _PARTS.items():
        found |= {f"claims {part} {name}": job for name, job in make(effort).items()}
    return found


def tables(flown: Mapping[str, Any], effort: Effort) -> Tables:
    """The tables from what `jobs` gave when flown."""
    parts = {part: _part(flown, part) for part in _PARTS}
    keep, fail = keeper_decks(**parts["keepers"])
    judged = noise_grid.judge(parts["grid"], effort)
    maneuvers = maneuver.maneuvers(parts["maneuvers"])
    fair = tuned_comparison.table(parts["fair"])
    claims = [
        *initialization.claims(initialization.by_time(flown), effort),
        *keeping.claims(keep, keeping.deck(parts["sweep"]["sweep"]), effort),
        *failure.claims(keep, fail, effort),
        *smc.claims(keep, fail, effort),
        *maneuver.claims(maneuvers, effort),
        *conclusions.claims(keep, maneuvers, fair, effort),
    ]
    claims = [noise_grid.with_levels(claim, judged) for claim in claims]
    return Tables(claims, noise_grid.table(judged), readings.table(parts["readings"]), fair)


def _part(flown: Mapping[str, Any], part: str) -> dict[str, Any]:
    """What was flown for a part, by its own names."""
    head = f"claims {part} "
    return {name.removeprefix(head): flights for name, flights in flown.items() if name.startswith(head)}
