"""The claims as files."""

import json
from collections.abc import Sequence
from dataclasses import asdict, fields

import pandas as pd

from baselines.thesis.claims.claim import Claim


def to_csv(claims: Sequence[Claim]) -> str:
    """One line per claim; the columns are its fields, empty where there is no interval."""
    columns = [field.name for field in fields(Claim)]
    return pd.DataFrame([asdict(claim) for claim in claims], columns=columns).to_csv(index=False)


def to_json(claims: Sequence[Claim]) -> str:
    """The same as a list of objects, null where there is no interval."""
    return json.dumps([asdict(claim) for claim in claims], indent=2, ensure_ascii=False, allow_nan=False) + "\n"
