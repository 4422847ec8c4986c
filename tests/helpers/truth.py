"""The independent nonlinear simulation of which tests/data holds rows (its README says how it was made)."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from formation_env.orbital.orbit import Orbit

CASES = ("space_circle", "projected_circle", "xy_ellipse", "following")
ORBIT = Orbit(altitude_m=600000.4)
"""Its leader at t = 0: a = 6978137 m."""
PERIOD_S = 5801.231805574421


def load(case: str, force: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (T,), s, and LVLH states (T, 6), m and m/s, of one case under one force model."""
    table = pd.read_csv(Path(__file__).parents[1] / "data" / f"{force}.csv")
    rows = table[table["case"] == case].drop(columns="case").to_numpy(float)
    return rows[:, 0], rows[:, 1:]
