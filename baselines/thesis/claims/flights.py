"""The flights that the claims share, as jobs: which laws, in what noise, how long."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import make_policy
from baselines.thesis import plan, scenarios
from baselines.thesis.flights import Flights
from baselines.thesis.jobs import Job, Law
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.seeds import seeds
from formation_env.task.scenario import Scenario

A_70_S2: Final = 1650.0
"""Factor of the control weight that gives a mean error of 70 m, at which section 5.2.3 compares, s^2."""


KEPT_S: Final = 60.0
"""Time between the instants that are kept."""


@dataclass(frozen=True)
class Noise:
    """What the thesis is silent on; by default as in the shipped scenarios.

    Attributes:
        sigma_pos_m: 1-sigma of each measured position axis, m; velocities are measured a hundredth as well per second.
        process_m_s2: 1-sigma of the random acceleration of each axis, m/s^2.
        initial_sigma_pos_m: 1-sigma of the unknown start's position, each axis, m.
        initial_sigma_vel_m_s: 1-sigma of the unknown start's velocity, each axis, m/s.
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
        """A scenario with this noise."""
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
    def words(self) -> str:
        """The noise in a sentence."""
        return (
            f"sensor {self.sigma_pos_m:g} m and {self.sigma_vel_m_s:g} m/s, process noise {self.process_m_s2:g} "
            f"m/s^2, start unknown by {self.initial_sigma_pos_m:g} m and {self.initial_sigma_vel_m_s:g} m/s "
            "(the thesis gives none of these)"
        )


@dataclass(frozen=True)
class Effort:
    """How much is flown, and in what noise.

    Attributes:
        noise: of all flights that have any.
        seeds: noise seeds of each flight.
        dt_s: time step of the headline flights, s.
        periods: keeping time of the headline flights, in periods.
        coarse_dt_s: time step of sweeps, of the mission and of the fair comparison, s.
        grid_dt_s: time step of the noise grid, s.
        grid_periods: keeping time of the noise grid and of the fair comparison, in periods.
        truths: true dynamics of the fair comparison.
        candidates: of each law in the fair comparison, along each of its two gains.
    """

    noise: Noise = Noise()
    seeds: int = 50
    dt_s: float = 1.0
    periods: int = 10
    coarse_dt_s: float = 10.0
    grid_dt_s: float = 2.0
    grid_periods: int = 2
    truths: tuple[str, ...] = ("modified_hcw", plan.DYNAMICS, NONLINEAR)
    candidates: int = 8

    @property
    def assumption(self) -> str:
        """The words for the headline flights."""
        return f"T = {self.dt_s:g} s, {self.periods} periods, {self.maneuver_assumption}"

    @property
    def maneuver_assumption(self) -> str:
        """The same without the times."""
        return f"{self.seeds} seeds; {self.noise.words}; eq. (2.62) as printed"

    @property
    def coarse(self) -> "Effort":
        """The same with the coarse step."""
        return replace(self, dt_s=self.coarse_dt_s)


@dataclass(frozen=True)
class Deck:
    """Flights of some laws, by name."""

    names: tuple[str, ...]
    flights: Flights

    def row(self, name: str) -> int:
        """Where a law's flights are."""
        return self.names.index(name)


@dataclass(frozen=True)
class WithPath(Law):
    """The error-state law with the thrust that the desired path itself takes."""

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """The policy for a scenario."""
        return make_policy("lqr", scenario, replace(super().make(scenario).settings, feedforward=True))  # type: ignore[attr-defined]


def error_state(control_s2: float | None = None) -> Law:
    """u = K (x_d - x_hat) (Ma 2009, eq. 4.10) with the printed weights, or with R = control_s2 I / n^2."""
    return replace(plan.LQR, control_s2=control_s2)


KEEPERS: Final[dict[str, Law]] = {
    "lqr": plan.LQR,
    "lqr_175": error_state(plan.FINER_S2),
    "lqr_70": error_state(A_70_S2),
    "lqr_feedforward": WithPath(plan.LQR.name, plan.LQR.shipped),
    "smc": plan.SMC,
}
"""Laws of the keeping flights: the thesis's two, the first one at two other weights, and with the path's own thrust."""


def as_printed(scenario: Scenario, effort: Effort) -> Scenario:
    """A scenario with the cross-track frequency as the thesis prints it, and with an effort's noise."""
    return plan.printed(effort.noise.on(scenario))


def deal(laws: Mapping[str, Law], scenario: Scenario, effort: Effort, few: int = 1) -> Job:
    """Laws side by side on the test seeds, of which an instant is kept every minute.

    Args:
        laws: by name.
        scenario: what they fly.
        effort: how many seeds.
        few: seeds whose states are kept.
    """
    every = max(1, round(KEPT_S / scenario.dt_s))
    return Job(scenario, tuple(laws.values()), tuple(seeds("test", effort.seeds)), every=every, few=few)


def keepers(effort: Effort) -> dict[str, Job]:
    """Sections 5.2.2 and 5.2.3 in one noise: `keep` without and `fail` with communication failure."""
    keep = scenarios.keeping(effort.periods, effort.dt_s)
    fail = scenarios.keeping_failure(effort.periods, dt_s=effort.dt_s)
    return {
        "keep": deal(KEEPERS, as_printed(keep, effort), effort, few=effort.seeds),
        "fail": deal(KEEPERS, as_printed(fail, effort), effort),
    }


def keeper_decks(keep: Flights, fail: Flights) -> tuple[Deck, Deck]:
    """Those flights by the laws' names."""
    return Deck(tuple(KEEPERS), keep), Deck(tuple(KEEPERS), fail)
