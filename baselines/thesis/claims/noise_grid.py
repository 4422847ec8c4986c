"""The claims over the noise that the thesis is silent on: the same sentences at each level."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, replace
from itertools import product
from typing import Any, Final

import pandas as pd

from baselines.thesis.claims import failure, keeping, smc
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.flights import Effort, Noise, keeper_decks, keepers
from baselines.thesis.flights import Flights
from baselines.thesis.jobs import Job

SENSORS_M: Final = (0.02, 2.0, 20.0)
PROCESSES_M_S2: Final = (0.0, 5e-6, 5e-5)
STARTS: Final = ((10.0, 0.02), (50.0, 0.05))
"""1-sigma of the unknown start, m and m/s."""
LEVELS: Final = tuple(
    Noise(sensor, process, *start) for start, sensor, process in product(STARTS, SENSORS_M, PROCESSES_M_S2)
)


KNOWN: Final = Noise(initial_sigma_pos_m=10.0, initial_sigma_vel_m_s=0.02)
"""Flown for as long as the headline, since the sliding mode takes hours to undo a drift."""


def _levels(effort: Effort) -> list[Effort]:
    """The effort at each level, with a longer step; the last is the long one."""
    short = [replace(effort, dt_s=effort.grid_dt_s, periods=effort.grid_periods, noise=noise) for noise in LEVELS]
    return [*short, replace(effort, dt_s=effort.grid_dt_s, noise=KNOWN)]


def jobs(effort: Effort) -> dict[str, Job]:
    """The flights of each level."""
    return {
        f"{name} {index}": job for index, level in enumerate(_levels(effort)) for name, job in keepers(level).items()
    }


def judge(flown: Mapping[str, Flights], effort: Effort) -> list[tuple[Effort, Claim]]:
    """The claims of sections 5.2.2 and 5.2.3 at each level."""
    judged = []
    for index, level in enumerate(_levels(effort)):
        keep, fail = keeper_decks(flown[f"keep {index}"], flown[f"fail {index}"])
        claims = [
            *keeping.at_one_noise(keep, level),
            *failure.claims(keep, fail, level),
            *smc.claims(keep, fail, level),
        ]
        judged += [(level, claim) for claim in claims if claim.low is not None]
    return judged


def table(judged: list[tuple[Effort, Claim]]) -> pd.DataFrame:
    """One line per level and claim."""
    lines: list[dict[str, Any]] = []
    for level, claim in judged:
        said = {"section": claim.section, "sentence": claim.sentence, "thesis_value": claim.thesis_value}
        found = {"ours": claim.ours, "low": claim.low, "high": claim.high, "verdict": claim.verdict}
        lines.append({**asdict(level.noise), "periods": level.periods, **said, **found})
    return pd.DataFrame(lines)


def with_levels(claim: Claim, judged: list[tuple[Effort, Claim]]) -> Claim:
    """A claim that also says how its sentence fares over the levels."""
    verdicts = Counter(c.verdict for _, c in judged if (c.section, c.sentence) == (claim.section, claim.sentence))
    if not verdicts:
        return claim
    counts = ", ".join(f"{verdict} at {count}" for verdict, count in verdicts.most_common())
    return replace(claim, assumption=f"{claim.assumption}. Over {verdicts.total()} noise levels: {counts}")
