"""Files of the claims."""

import json
from collections.abc import Sequence
from dataclasses import asdict, fields

import pandas as pd

from baselines.thesis.claims.claim import Claim


def to_csv(claims: Sequence[Claim]) -> str:
    """CSV with one line per claim; columns are its fields, empty without an interval."""
    columns = [field.name for field in fields(Claim)]
    return pd.DataFrame([asdict(claim) for claim in claims], columns=columns).to_csv(index=False)


def to_json(claims: Sequence[Claim]) -> str:
    """JSON list of the claims; null without an interval."""
    return json.dumps([asdict(claim) for claim in claims], indent=2, ensure_ascii=False, allow_nan=False) + "\n"
