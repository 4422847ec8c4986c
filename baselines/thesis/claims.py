"""The claims table: every number and comparison that chapters 5 and 6 state, and what became of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from baselines.thesis import (
    claims_conclusions,
    claims_failure,
    claims_fair,
    claims_grid,
    claims_initialization,
    claims_keeping,
    claims_maneuver,
    claims_readings,
    claims_smc,
    plan,
)
from baselines.thesis.claim import Claim
from baselines.thesis.claims_fair import Comparison
from baselines.thesis.claims_flights import Effort, keeper_decks, keepers
from baselines.thesis.jobs import Job

_PARTS = {
    "keepers": keepers,
    "sweep": lambda effort: {"sweep": claims_keeping.sweep(effort.coarse)},
    "maneuvers": claims_maneuver.jobs,
    "grid": claims_grid.jobs,
    "readings": claims_readings.jobs,
    "fair": claims_fair.jobs,
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
    judged = claims_grid.judge(parts["grid"], effort)
    maneuvers = claims_maneuver.maneuvers(parts["maneuvers"])
    fair = claims_fair.table(parts["fair"])
    claims = [
        *claims_initialization.claims(claims_initialization.by_time(flown), effort),
        *claims_keeping.claims(keep, claims_keeping.deck(parts["sweep"]["sweep"]), effort),
        *claims_failure.claims(keep, fail, effort),
        *claims_smc.claims(keep, fail, effort),
        *claims_maneuver.claims(maneuvers, effort),
        *claims_conclusions.claims(keep, maneuvers, fair, effort),
    ]
    claims = [claims_grid.with_levels(claim, judged) for claim in claims]
    return Tables(claims, claims_grid.table(judged), claims_readings.table(parts["readings"]), fair)


def _part(flown: Mapping[str, Any], part: str) -> dict[str, Any]:
    """What was flown for a part, by its own names."""
    head = f"claims {part} "
    return {name.removeprefix(head): flights for name, flights in flown.items() if name.startswith(head)}
