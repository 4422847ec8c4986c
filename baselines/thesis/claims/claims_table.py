"""Table of all claims: every number and comparison stated in chapters 5 and 6, with its verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from baselines.thesis import figure_flights
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
from baselines.thesis.claims.shared_flights import ClaimOptions, keeping_flights, keeping_jobs
from baselines.thesis.claims.tuned_comparison import TunedComparison
from baselines.thesis.flight_job import FlightJob

_PARTS: Final[dict[str, Callable[[ClaimOptions], Mapping[str, FlightJob | TunedComparison]]]] = {
    "keeping": keeping_jobs,
    "sweep": lambda options: {"sweep": keeping.sweep(options.coarse)},
    "maneuvers": maneuver.maneuver_jobs,
    "grid": noise_grid.noise_grid_jobs,
    "readings": readings.reading_jobs,
    "fair": tuned_comparison.tuned_jobs,
}


@dataclass(frozen=True)
class ClaimTables:
    """Tables of the thesis's claims.

    Attributes:
        claims: the table, in the thesis's order.
        noise: the statements at each noise level.
        readings: which reading of the settings reproduces the figures.
        fair: LQR and SMC, tuned alike.
    """

    claims: list[Claim]
    noise: pd.DataFrame
    readings: pd.DataFrame
    fair: pd.DataFrame


def claim_jobs(options: ClaimOptions) -> dict[str, FlightJob | TunedComparison]:
    """All jobs of the claims by name."""
    jobs: dict[str, FlightJob | TunedComparison] = dict(figure_flights.initializations(options.dt_s))
    for part, make in _PARTS.items():
        jobs |= {f"claims {part} {name}": job for name, job in make(options).items()}
    return jobs


def tables(flown: Mapping[str, Any], options: ClaimOptions) -> ClaimTables:
    """Build the tables from the flown jobs of `claim_jobs`."""
    parts = {part: _part(flown, part) for part in _PARTS}
    keep, fail = keeping_flights(**parts["keeping"])
    judged = noise_grid.claims_by_level(parts["grid"], options)
    maneuvers = maneuver.maneuvers(parts["maneuvers"])
    fair = tuned_comparison.tuned_table(parts["fair"])
    claims = [
        *initialization.claims(initialization.by_time(flown), options),
        *keeping.claims(keep, keeping.law_flights(parts["sweep"]["sweep"]), options),
        *failure.claims(keep, fail, options),
        *smc.claims(keep, fail, options),
        *maneuver.claims(maneuvers, options),
        *conclusions.claims(keep, maneuvers, fair, options),
    ]
    claims = [noise_grid.with_levels(claim, judged) for claim in claims]
    return ClaimTables(claims, noise_grid.noise_table(judged), readings.reading_table(parts["readings"]), fair)


def _part(flown: Mapping[str, Any], part: str) -> dict[str, Any]:
    """Flown jobs of a part, by the part's own names."""
    head = f"claims {part} "
    return {name.removeprefix(head): flights for name, flights in flown.items() if name.startswith(head)}
