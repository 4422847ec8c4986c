"""No dropouts."""

from typing import Literal

from formation_env.dropout.base import Dropout
from formation_env.settings import settings


@settings
class NoDropout(Dropout):
    """Every measurement arrives."""

    kind: Literal["none"] = "none"
