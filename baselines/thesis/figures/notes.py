"""What came out, beside what the thesis says: one sentence or two below a figure, with the numbers of the flights."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from baselines.report.results import number
from baselines.thesis import plan
from baselines.thesis.flights import Flights
from formation_env.dynamics.base import Array

Flown = Mapping[str, Flights]


def nothing(flown: Flown) -> str:
    """No note."""
    return ""
