"""Claims at several noise levels, since the thesis states none."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, replace
from itertools import product
from typing import Any, Final

import pandas as pd

from baselines.thesis.claims import failure, keeping, smc
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.shared_flights import ClaimOptions, Noise, keeping_flights, keeping_jobs
from baselines.thesis.flight_job import FlightJob
from baselines.thesis.recorded_flights import Flights

SENSORS_M: Final = (0.02, 2.0, 20.0)
PROCESSES_M_S2: Final = (0.0, 5e-6, 5e-5)
STARTS: Final = ((10.0, 0.02), (50.0, 0.05))
"""1-sigma of the initial state, m and m/s."""
LEVELS: Final = tuple(
    Noise(sensor, process, *start) for start, sensor, process in product(STARTS, SENSORS_M, PROCESSES_M_S2)
)


KNOWN: Final = Noise(initial_sigma_pos_m=10.0, initial_sigma_vel_m_s=0.02)
"""Noise of a flight as long as the headline's, since the sliding mode takes hours to correct a drift."""


def _levels(options: ClaimOptions) -> list[ClaimOptions]:
    """Options of each level, with a longer step; the last is the long flight."""
    short = [replace(options, dt_s=options.grid_dt_s, periods=options.grid_periods, noise=noise) for noise in LEVELS]
    return [*short, replace(options, dt_s=options.grid_dt_s, noise=KNOWN)]


def noise_grid_jobs(options: ClaimOptions) -> dict[str, FlightJob]:
    """Jobs of each level."""
    return {
        f"{name} {index}": job
        for index, level in enumerate(_levels(options))
        for name, job in keeping_jobs(level).items()
    }


def claims_by_level(flown: Mapping[str, Flights], options: ClaimOptions) -> list[tuple[ClaimOptions, Claim]]:
    """Decide the claims of sections 5.2.2 and 5.2.3 at each level."""
    decided = []
    for index, level in enumerate(_levels(options)):
        keep, fail = keeping_flights(flown[f"keep {index}"], flown[f"fail {index}"])
        claims = [
            *keeping.at_one_noise(keep, level),
            *failure.claims(keep, fail, level),
            *smc.claims(keep, fail, level),
        ]
        decided += [(level, claim) for claim in claims if claim.low is not None]
    return decided


def noise_table(decided: list[tuple[ClaimOptions, Claim]]) -> pd.DataFrame:
    """Table with one line per level and claim."""
    lines: list[dict[str, Any]] = []
    for level, claim in decided:
        stated = {"section": claim.section, "sentence": claim.sentence, "thesis_value": claim.thesis_value}
        result = {"ours": claim.ours, "low": claim.low, "high": claim.high, "verdict": claim.verdict}
        lines.append({**asdict(level.noise), "periods": level.periods, **stated, **result})
    return pd.DataFrame(lines)


def with_levels(claim: Claim, decided: list[tuple[ClaimOptions, Claim]]) -> Claim:
    """Add the verdicts over all levels to a claim's assumption."""
    verdicts = Counter(c.verdict for _, c in decided if (c.section, c.sentence) == (claim.section, claim.sentence))
    if not verdicts:
        return claim
    counts = ", ".join(f"{verdict} at {count}" for verdict, count in verdicts.most_common())
    return replace(claim, assumption=f"{claim.assumption}. Over {verdicts.total()} noise levels: {counts}")
