"""Flights shared by the claims, as jobs: laws, noise, duration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import make_policy
from baselines.thesis import figure_flights, scenarios
from baselines.thesis.flight_job import FlightJob, Law
from baselines.thesis.recorded_flights import Flights
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.seeds import seeds
from formation_env.task.scenario import Scenario

A_70_S2: Final = 1650.0
"""Factor of the control weight with a mean error of 70 m, at which section 5.2.3 compares, s^2."""


RECORD_INTERVAL_S: Final = 60.0
"""Time between recorded instants, s."""


@dataclass(frozen=True)
class Noise:
    """Noise levels, which the thesis does not state; defaults are those of the shipped scenarios.

    Attributes:
        sigma_pos_m: 1-sigma of each measured position axis, m; velocities are measured a hundredth as well per second.
        process_m_s2: 1-sigma of the random acceleration of each axis, m/s^2.
        initial_sigma_pos_m: 1-sigma of the initial position, each axis, m.
        initial_sigma_vel_m_s: 1-sigma of the initial velocity, each axis, m/s.
    """

    sigma_pos_m: float = 2.0
    process_m_s2: float = 5e-6
    initial_sigma_pos_m: float = 50.0
    initial_sigma_vel_m_s: float = 0.05

    @property
    def sigma_vel_m_s(self) -> float:
        """1-sigma of each measured velocity axis, m/s."""
        return self.sigma_pos_m / 100

    def on(self, scenario: Scenario) -> Scenario:
        """Scenario with this noise."""
        return replace(
            scenario,
            sensor=replace(scenario.sensor, sigma_pos_m=self.sigma_pos_m, sigma_vel_m_s=self.sigma_vel_m_s),
            process_noise_m_s2=self.process_m_s2,
            start=replace(
                scenario.start,
                initial_sigma_pos_m=self.initial_sigma_pos_m,
                initial_sigma_vel_m_s=self.initial_sigma_vel_m_s,
            ),
        )

    @property
    def text(self) -> str:
        """Text of the noise levels."""
        return (
            f"sensor {self.sigma_pos_m:g} m and {self.sigma_vel_m_s:g} m/s, process noise {self.process_m_s2:g} "
            f"m/s^2, initial state {self.initial_sigma_pos_m:g} m and {self.initial_sigma_vel_m_s:g} m/s "
            "(the thesis gives none of these)"
        )


@dataclass(frozen=True)
class ClaimOptions:
    """Extent of the flights of the claims, and their noise.

    Attributes:
        noise: of all flights that have any.
        seeds: noise seeds of each flight.
        dt_s: time step of the headline flights, s.
        periods: keeping time of the headline flights, in periods.
        coarse_dt_s: time step of sweeps, of the mission and of the tuned comparison, s.
        grid_dt_s: time step of the noise grid, s.
        grid_periods: keeping time of the noise grid and of the tuned comparison, in periods.
        truths: true dynamics of the tuned comparison.
        candidates: of each law in the tuned comparison, along each of its two parameters.
    """

    noise: Noise = Noise()
    seeds: int = 50
    dt_s: float = 1.0
    periods: int = 10
    coarse_dt_s: float = 10.0
    grid_dt_s: float = 2.0
    grid_periods: int = 2
    truths: tuple[str, ...] = ("modified_hcw", figure_flights.DYNAMICS, NONLINEAR)
    candidates: int = 8

    @property
    def assumption(self) -> str:
        """Assumption of the headline flights."""
        return f"T = {self.dt_s:g} s, {self.periods} periods, {self.maneuver_assumption}"

    @property
    def maneuver_assumption(self) -> str:
        """Assumption of the headline flights, without the times."""
        return f"{self.seeds} seeds; {self.noise.text}; eq. (2.62) as printed"

    @property
    def coarse(self) -> "ClaimOptions":
        """Options with the coarse step."""
        return replace(self, dt_s=self.coarse_dt_s)


@dataclass(frozen=True)
class LawFlights:
    """Flights of several laws, looked up by name."""

    names: tuple[str, ...]
    flights: Flights

    def row(self, name: str) -> int:
        """Index of a law."""
        return self.names.index(name)


@dataclass(frozen=True)
class WithPath(Law):
    """Error-state law with the feedforward thrust of the desired path."""

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """The policy for a scenario."""
        return make_policy("lqr", scenario, replace(super().make(scenario).settings, feedforward=(True)))


def error_state(control_s2: float | None = None) -> Law:
    """u = K (x_d - x_hat) (Ma 2009, eq. 4.10) with the printed weights, or with R = control_s2 I / n^2."""
    return replace(figure_flights.LQR, control_s2=control_s2)


KEEPING_LAWS: Final[dict[str, Law]] = {
    "lqr": figure_flights.LQR,
    "lqr_175": error_state(figure_flights.TIGHTER_S2),
    "lqr_70": error_state(A_70_S2),
    "lqr_feedforward": WithPath(figure_flights.LQR.name, figure_flights.LQR.shipped),
    "smc": figure_flights.SMC,
}
"""Laws of the keeping flights: LQR and SMC of the thesis, LQR with two other weights and with feedforward."""


def as_printed(scenario: Scenario, options: ClaimOptions) -> Scenario:
    """Scenario with the cross-track frequency as printed, and with the options' noise."""
    return figure_flights.printed(options.noise.on(scenario))


def make_job(laws: Mapping[str, Law], scenario: Scenario, options: ClaimOptions, few: int = 1) -> FlightJob:
    """Job of several laws on the test seeds, with an instant recorded every minute.

    Args:
        laws: by name.
        scenario: scenario flown.
        options: number of seeds.
        few: number of seeds whose states are recorded.
    """
    every = max(1, round(RECORD_INTERVAL_S / scenario.dt_s))
    return FlightJob(scenario, tuple(laws.values()), tuple(seeds("test", options.seeds)), every=every, few=few)


def keeping_jobs(options: ClaimOptions) -> dict[str, FlightJob]:
    """Jobs of sections 5.2.2 and 5.2.3 at one noise level: `keep` without, `fail` with communication failure."""
    keep = scenarios.keeping(options.periods, options.dt_s)
    fail = scenarios.keeping_failure(options.periods, dt_s=options.dt_s)
    return {
        "keep": make_job(KEEPING_LAWS, as_printed(keep, options), options, few=options.seeds),
        "fail": make_job(KEEPING_LAWS, as_printed(fail, options), options),
    }


def keeping_flights(keep: Flights, fail: Flights) -> tuple[LawFlights, LawFlights]:
    """Flights of the jobs of `keeping_jobs`."""
    return LawFlights(tuple(KEEPING_LAWS), keep), LawFlights(tuple(KEEPING_LAWS), fail)
