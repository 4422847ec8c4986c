"""The flights that the claims share, and how they are flown: side by side, in processes of their own."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from typing import Any, Final

from baselines.policy import AccelerationPolicy
from baselines.registry import make_policy
from baselines.thesis import scenarios
from baselines.thesis.flights import Flights, fly
from formation_env.scenario import Scenario
from formation_env.seeds import seeds

PRINTED: Final = "printed_hcw"
"""The dynamics with which the thesis's closed-loop figures come out, see `baselines.thesis.claims_readings`."""

A_175_S2: Final = 4150.0
"""Factor of the control weight with which the error-state law keeps within the 175 m of Figure 5.9, s^2."""
A_70_S2: Final = 1650.0
"""The same for a mean error of 70 m, the accuracy at which section 5.2.3 compares, s^2."""
A_MANEUVER_S2: Final = 1500.0
"""The same for the 0.06 m/s^2 of Figure 5.20; the thesis prints no weight for its maneuvers, s^2."""


@dataclass(frozen=True)
class Noise:
    """What the thesis is silent on; by default as in the shipped scenarios.

    Attributes:
        sigma_pos_m: 1-sigma of each measured position axis, m; velocities are measured a hundredth as well per second.
        process_m_s2: 1-sigma of the random acceleration of each axis, m/s^2.
        spread_pos_m: 1-sigma of the unknown start's position, each axis, m.
        spread_vel_m_s: 1-sigma of the unknown start's velocity, each axis, m/s.
    """

    sigma_pos_m: float = 2.0
    process_m_s2: float = 5e-6
    spread_pos_m: float = 50.0
    spread_vel_m_s: float = 0.05

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
            start=replace(scenario.start, spread_pos_m=self.spread_pos_m, spread_vel_m_s=self.spread_vel_m_s),
        )

    @property
    def words(self) -> str:
        """The noise in a sentence."""
        return (
            f"sensor {self.sigma_pos_m:g} m and {self.sigma_vel_m_s:g} m/s, process noise {self.process_m_s2:g} m/s^2, "
            f"start unknown by {self.spread_pos_m:g} m and {self.spread_vel_m_s:g} m/s (the thesis gives none of these)"
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
        candidates: of each law in the fair comparison, along each of its two gains.
        processes: at once.
    """

    noise: Noise = Noise()
    seeds: int = 50
    dt_s: float = 1.0
    periods: int = 10
    coarse_dt_s: float = 10.0
    grid_dt_s: float = 2.0
    grid_periods: int = 2
    candidates: int = 8
    processes: int = 2

    @property
    def assumption(self) -> str:
        """The words for the headline flights."""
        return (
            f"T = {self.dt_s:g} s, {self.periods} periods, {self.seeds} seeds; {self.noise.words}; eq. (2.62) as printed"
        )

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


Law = Callable[[Scenario], AccelerationPolicy]


def error_state(control_s2: float | None = None, feedforward: bool = False) -> Law:
    """u = K (x_d - x_hat) (Ma 2009, eq. 4.10) with the printed weights, or with R = control_s2 I / n^2."""

    def make(scenario: Scenario) -> AccelerationPolicy:
        policy = scenarios.law("lqr", scenario, "thesis_keeping", control_s2)
        return make_policy("lqr", scenario, replace(policy.gains, feedforward=True)) if feedforward else policy  # type: ignore[attr-defined]

    return make


def sliding(scenario: Scenario) -> AccelerationPolicy:
    """The sliding mode law with the gains of section 5.2.3."""
    return scenarios.law("smc", scenario, "thesis_keeping")


KEEPERS: Final[dict[str, Law]] = {
    "lqr": error_state(),
    "lqr_175": error_state(A_175_S2),
    "lqr_70": error_state(A_70_S2),
    "lqr_feedforward": error_state(feedforward=True),
    "smc": sliding,
}
"""Laws of the keeping flights: the thesis's two, the first one at two other weights, and with the path's own thrust."""


def as_printed(scenario: Scenario, effort: Effort) -> Scenario:
    """A scenario with the cross-track frequency as the thesis prints it, and with an effort's noise."""
    return replace(effort.noise.on(scenario), dynamics=PRINTED)


def deal(laws: Mapping[str, Law], scenario: Scenario, effort: Effort, few: int = 1, every_s: float = 60.0) -> Deck:
    """Fly laws side by side on the test seeds.

    Args:
        laws: by name.
        scenario: what they fly.
        effort: how many seeds.
        few: seeds whose states are kept.
        every_s: time between kept instants, s.
    """
    policies = [make(scenario) for make in laws.values()]
    every = max(1, round(every_s / scenario.dt_s))
    return Deck(tuple(laws), fly(policies, scenario, seeds("test", effort.seeds), every=every, few=few))


def keeping(effort: Effort) -> Deck:
    """Section 5.2.2a and 5.2.3a."""
    scenario = as_printed(scenarios.keeping(effort.periods, effort.dt_s), effort)
    return deal(KEEPERS, scenario, effort, few=effort.seeds)


def failure(effort: Effort) -> Deck:
    """Section 5.2.2c and 5.2.3b."""
    return deal(KEEPERS, as_printed(scenarios.keeping_failure(effort.periods, dt_s=effort.dt_s), effort), effort)


Job = Callable[[Effort], Any]


def run(jobs: Mapping[str, Job], effort: Effort, progress: Callable[[str], Any]) -> dict[str, Any]:
    """Results of jobs by name, found in processes of their own if there is more than one.

    Args:
        jobs: by name, the longest first; functions of a module, so that another process can find them.
        effort: handed to each.
        progress: called with a job's name when it is done.
    """
    results: dict[str, Any] = {}
    if effort.processes == 1:
        for name, job in jobs.items():
            results[name] = job(effort)
            progress(name)
        return results
    with ProcessPoolExecutor(effort.processes) as pool:
        names = {pool.submit(job, effort): name for name, job in jobs.items()}
        for future in as_completed(names):
            results[names[future]] = future.result()
            progress(names[future])
    return results


def numbered(values: Sequence[float]) -> dict[str, Law]:
    """Error-state laws at some control weights, by weight."""
    return {f"{value:g}": error_state(value) for value in values}
