"""Which reading of the settings of section 5.2.2 gives the figures: 300 m, 4e-3 m/s^2 and mostly the z-axis at once.

The print gives a = 12000, R with a garbled first entry, two laws (eq. 4.10 and 4.17), a rounded start and k without its n
(eq. 2.62); it gives no noise and no sampling time. Each reading is flown alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from baselines.policy import AccelerationPolicy
from baselines.registry import make_policy
from baselines.thesis import scenarios
from baselines.thesis.claims_flights import PRINTED, Effort, Law, Noise, error_state, sliding
from baselines.thesis.flights import fly
from formation_env.scenario import Scenario
from formation_env.seeds import seeds

A_S2: Final = 12000.0
ROUNDED: Final = (2000.0, 369.3, 3464.1, 0.2, -4.3, 0.3)
"""The start as printed, m and m/s."""
QUIET: Final = Noise(0.0, 0.0, 0.0, 0.0)
NOISY: Final = Noise(20.0, 5e-5, 50.0, 0.05)


def tracking(scenario: Scenario) -> AccelerationPolicy:
    """The quasi-static tracker (eq. 4.17-4.19) with the printed weights."""
    return scenarios.law("lqr_tracking", scenario, "thesis_keeping")


def weighted(power: int, axes: Sequence[int]) -> Law:
    """The error-state law with 12000 n^power in place of 12000 / n^2 for some axes of R."""

    def make(scenario: Scenario) -> AccelerationPolicy:
        n = scenario.orbit.mean_motion_rad_s
        control_s2 = tuple(A_S2 * n ** (power + 2) if axis in axes else A_S2 for axis in range(3))
        gains = scenarios.law("lqr", scenario, "thesis_keeping").gains  # type: ignore[attr-defined]
        return make_policy("lqr", scenario, replace(gains, hold=replace(gains.hold, control_s2=control_s2)))

    return make


@dataclass(frozen=True)
class Reading:
    """One way to read the settings.

    Attributes:
        words: in a line.
        law: the control law.
        dynamics: of truth, filter and law.
        noise: of the flight.
        dt_s: time step, s; None is the effort's.
        start: true start (6,), m and m/s; None is the formation's.
    """

    words: str
    law: Law
    dynamics: str = "modified_hcw"
    noise: Noise = QUIET
    dt_s: float | None = None
    start: tuple[float, ...] | None = None


READINGS: Final = (
    Reading("error-state law, k as printed", error_state(), PRINTED),
    Reading("error-state law, k as printed, a = 4150", error_state(4150.0), PRINTED),
    Reading("error-state law, k as printed, 60 s", error_state(), PRINTED, dt_s=60.0),
    Reading("error-state law, k as printed, start as printed", error_state(), PRINTED, start=ROUNDED),
    Reading("error-state law, k as printed, much noise", error_state(), PRINTED, NOISY),
    Reading("error-state law, k with its n", error_state()),
    Reading("error-state law, k with its n, start as printed", error_state(), start=ROUNDED),
    Reading("error-state law, k with its n, much noise", error_state(), noise=NOISY),
    Reading("error-state law, k with its n, first entry of R 12000 n^2", weighted(2, [0])),
    Reading("error-state law, k with its n, all of R 12000 n^2", weighted(2, [0, 1, 2])),
    Reading("quasi-static tracker, k with its n", tracking),
    Reading("quasi-static tracker, k with its n, 60 s", tracking, dt_s=60.0),
    Reading("quasi-static tracker, k as printed", tracking, PRINTED),
    Reading("error-state law and the path's thrust, k as printed", error_state(feedforward=True), PRINTED),
    Reading("sliding mode, k as printed", sliding, PRINTED),
)


def readings(effort: Effort, progress: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """One line per reading: errors, thrust, the z-axis' share, delta-v, and whether the figures come out."""
    lines = []
    for reading in READINGS:
        lines.append(_line(reading, effort))
        progress()
    return pd.DataFrame(lines)


def _line(reading: Reading, effort: Effort) -> dict[str, str | float | bool]:
    """Fly a reading; without noise one seed is enough."""
    scenario = scenarios.keeping(1.0, reading.dt_s or effort.dt_s)
    scenario = replace(reading.noise.on(scenario), dynamics=reading.dynamics)
    count = 1 if reading.noise == QUIET else effort.seeds
    start = None if reading.start is None else np.array(reading.start)
    flights = fly([reading.law(scenario)], scenario, seeds("test", count), every=60, start=start)
    axes = flights.effort()[0].mean(axis=0)
    error_m, accel_m_s2 = float(flights.max_error()[0].mean()), float(flights.max_accel()[0].mean())
    share = float(axes[2] / axes.sum())
    return {
        "reading": reading.words,
        "max_error_m": error_m,
        "mean_error_m": float(flights.mean_error()[0].mean()),
        "max_accel_m_s2": accel_m_s2,
        "z_share": share,
        "delta_v_per_period_m_s": float(flights.delta_v()[0].mean()),
        "gives_the_figures": bool(250 < error_m < 310 and 2e-3 < accel_m_s2 < 4e-3 and share > 0.5),
    }
