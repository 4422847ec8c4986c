"""Readings of the settings of section 5.2.2: which one gives 300 m, 4e-3 m/s^2 and mostly z-axis effort at once.

The print gives a = 12000, R with a garbled first entry, two laws (eq. 4.10 and 4.17), a rounded start and k without its
n (eq. 2.62); it gives no noise and no sampling time. Each reading is a separate flight.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import pandas as pd

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import make_policy
from baselines.thesis import figure_flights, scenarios
from baselines.thesis.claims.shared_flights import RECORD_INTERVAL_S, ClaimOptions, Noise, WithPath, error_state
from baselines.thesis.flight_job import FlightJob, Law
from baselines.thesis.recorded_flights import Flights
from formation_env.evaluation.seeds import seeds
from formation_env.task.scenario import Scenario

A_S2: Final = 12000.0
ROUNDED: Final = (2000.0, 369.3, 3464.1, 0.2, -4.3, 0.3)
"""Initial state as printed, m and m/s."""
QUIET: Final = Noise(0.0, 0.0, 0.0, 0.0)
NOISY: Final = Noise(20.0, 5e-5, 50.0, 0.05)


@dataclass(frozen=True)
class Weighted(Law):
    """Error-state law with 12000 n^2 instead of 12000 / n^2 for some axes of R.

    Attributes:
        axes: those axes.
    """

    axes: tuple[int, ...] = ()

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """The policy for a scenario."""
        n = scenario.orbit.mean_motion_rad_s
        control_s2 = tuple(A_S2 * n**4 if axis in self.axes else A_S2 for axis in range(3))
        settings = super().make(scenario).settings
        return make_policy("lqr", scenario, replace(settings, hold=replace(settings.hold, control_s2=control_s2)))


@dataclass(frozen=True)
class Integrated(Law):
    """Tracking law with g integrated backwards along the path (eq. 4.19), which does not lag."""

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """The policy for a scenario."""
        settings = super().make(scenario).settings
        return make_policy("lqr_quasi_static", scenario, replace(settings, feedforward="integrated"))


LQR, TRACKING, SMC = figure_flights.LQR, figure_flights.TRACKING, figure_flights.SMC
WITH_PATH: Final = WithPath(LQR.name, LQR.shipped)
INTEGRATED: Final = Integrated(TRACKING.name, TRACKING.shipped)
FIRST, ALL = (Weighted(LQR.name, LQR.shipped, axes=axes) for axes in ((0,), (0, 1, 2)))


@dataclass(frozen=True)
class Reading:
    """One way to read the settings.

    Attributes:
        text: one line of description.
        law: the control law.
        dynamics: of truth, filter and law.
        noise: of the flight.
        dt_s: time step, s; None is the options'.
        start: true start (6,), m and m/s; None is the formation's.
    """

    text: str
    law: Law
    dynamics: str = "modified_hcw"
    noise: Noise = QUIET
    dt_s: float | None = None
    start: tuple[float, ...] | None = None


READINGS: Final = (
    Reading("error-state law, k as printed", LQR, figure_flights.DYNAMICS),
    Reading("error-state law, k as printed, a = 4150", error_state(figure_flights.TIGHTER_S2), figure_flights.DYNAMICS),
    Reading("error-state law, k as printed, 60 s", LQR, figure_flights.DYNAMICS, dt_s=60.0),
    Reading("error-state law, k as printed, start as printed", LQR, figure_flights.DYNAMICS, start=ROUNDED),
    Reading("error-state law, k as printed, much noise", LQR, figure_flights.DYNAMICS, NOISY),
    Reading("error-state law, k with its n", LQR),
    Reading("error-state law, k with its n, start as printed", LQR, start=ROUNDED),
    Reading("error-state law, k with its n, much noise", LQR, noise=NOISY),
    Reading("error-state law, k with its n, first entry of R 12000 n^2", FIRST),
    Reading("error-state law, k with its n, all of R 12000 n^2", ALL),
    Reading("quasi-static tracker, k with its n", TRACKING),
    Reading("quasi-static tracker, k with its n, 60 s", TRACKING, dt_s=60.0),
    Reading("quasi-static tracker, k as printed", TRACKING, figure_flights.DYNAMICS),
    Reading("tracker with integrated g, k with its n", INTEGRATED),
    Reading("tracker with integrated g, k as printed", INTEGRATED, figure_flights.DYNAMICS),
    Reading("error-state law and the path's thrust, k as printed", WITH_PATH, figure_flights.DYNAMICS),
    Reading("sliding mode, k as printed", SMC, figure_flights.DYNAMICS),
)


def reading_jobs(options: ClaimOptions) -> dict[str, FlightJob]:
    """Jobs of one period for each reading; without noise one seed suffices."""
    return {reading.text: _job(reading, options) for reading in READINGS}


def _job(reading: Reading, options: ClaimOptions) -> FlightJob:
    scenario = reading.noise.on(scenarios.keeping(1.0, reading.dt_s or options.dt_s))
    count = 1 if reading.noise == QUIET else options.seeds
    return FlightJob(
        replace(scenario, dynamics=reading.dynamics),
        (reading.law,),
        tuple(seeds("test", count)),
        every=max(1, round(RECORD_INTERVAL_S / scenario.dt_s)),
        start=reading.start,
    )


def reading_table(flown: Mapping[str, Flights]) -> pd.DataFrame:
    """Table with one line per reading: errors, thrust, z-axis share, delta-v, whether the figures are reproduced."""
    return pd.DataFrame([_line(reading.text, flown[reading.text]) for reading in READINGS])


def _line(text: str, flights: Flights) -> dict[str, str | float | bool]:
    axes = flights.effort()[0].mean(axis=0)
    error_m, accel_m_s2 = float(flights.max_error()[0].mean()), float(flights.max_accel()[0].mean())
    share = float(axes[2] / axes.sum())
    return {
        "reading": text,
        "max_error_m": error_m,
        "mean_error_m": float(flights.mean_error()[0].mean()),
        "max_accel_m_s2": accel_m_s2,
        "z_share": share,
        "delta_v_per_period_m_s": float(flights.delta_v()[0].mean()),
        "gives_the_figures": bool(250 < error_m < 310 and 2e-3 < accel_m_s2 < 4e-3 and share > 0.5),
    }
