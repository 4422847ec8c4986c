"""Flights for the figures of chapter 5. To read the thesis's settings differently, change the constants here.

The thesis does not print all settings, and some printed ones do not reproduce its figures. Section 5.2.1 is reproduced
by the trajectory-following regulator (eq. 4.17-4.19), the closed loops with noise by error-state feedback with the
printed weights on the dynamics as printed (see `formation_env.dynamics.printed_hcw`).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from baselines.thesis import scenarios
from baselines.thesis.flight_job import FlightJob, Law
from formation_env.formations import ProjectedCircle
from formation_env.task.scenario import Scenario

DYNAMICS: Final = "printed_hcw"
"""Default dynamics of flights with noise."""
INITIALIZATION: Final = Law("lqr_quasi_static", "thesis_initialization")
LQR: Final = Law("lqr", "thesis_keeping")
TIGHTER_S2: Final = 4150.0
"""Factor a with the maximum error of Figure 5.9, 175 m; a third of the printed one, s^2."""
TIGHTER: Final = Law("lqr", "thesis_keeping", TIGHTER_S2)
TRACKING: Final = Law("lqr_quasi_static", "thesis_keeping")
SMC: Final = Law("smc", "thesis_keeping")
SWEEP_S2: Final = (100.0, 300.0, 1000.0, 40000.0, 100000.0, 200000.0)
"""Factors a of the control weight a I / n^2 that, with those of the laws above, reach Figure 5.10's accuracies, s^2."""
WEIGHTS: Final = (LQR, TIGHTER, *(Law("lqr", "thesis_keeping", factor) for factor in SWEEP_S2))
KEEPING: Final = (*WEIGHTS, SMC)
CORRECTED: Final = (LQR, TRACKING)
FAILURE: Final = (LQR, SMC)
"""Laws of the job `failure`."""
MANEUVER_S2: Final = 1500.0
"""Factor a of sections 5.2.4 and 5.2.5, which print none; it gives the 0.06 m/s^2 of Figure 5.20."""
RECONFIGURATION: Final = Law("lqr", "thesis_reconfiguration", MANEUVER_S2)
MISSION: Final = Law("lqr", "thesis_mission", MANEUVER_S2)
TRANSFER_PERIODS: Final = tuple(round(0.1 * k, 1) for k in range(1, 15))
"""Transfer times of Figure 5.5, in periods of the orbit."""
KEEPING_PERIODS: Final = (1, 2, 5, 10)
"""Keeping times of Figure 5.10, in periods of the orbit."""
FAR_ENTRY: Final = ProjectedCircle(x0_m=0.0, vx0_m_s=-1.8)
"""The opposite point of the circle, [0, -3324, 0, -1.8, 0, -3.6]: 8.3 km away from the following orbit's 5 km."""
MISSION_ENTRY: Final = FAR_ENTRY
"""After the ellipse the follower is on the other side of the leader; the entry near to it gives Figure 5.25."""
SMALL_VELOCITY_M_S: Final = (2.0, 2.0, 0.0)
LARGE_VELOCITY_M_S: Final = (30.0, 30.0, 0.0)
"""Initial velocities relative to the following orbit; the thesis does not print its own, m/s."""
RECORD_INTERVAL_S: Final = 20.0
"""Time between recorded instants of long flights, s."""


def printed(scenario: Scenario) -> Scenario:
    """Scenario with the dynamics as printed."""
    return replace(scenario, dynamics=DYNAMICS)


def figure_jobs(seeds: Sequence[int], dt_s: float | None = None, periods: float = 10.0) -> dict[str, FlightJob]:
    """All flights of the figures by name.

    Args:
        seeds: one per episode of each law; flights without noise have one.
        dt_s: time step, s; the shipped scenarios' 1 s if left out.
        periods: keeping time, in periods of the orbit; 10 in the thesis.
    """
    return {
        **initializations(dt_s),
        **keepings(tuple(seeds), dt_s, periods),
        **reconfigurations(tuple(seeds), dt_s),
        "mission": _long(printed(scenarios.mission(dt_s, MISSION_ENTRY)), (MISSION,), tuple(seeds)),
    }


def initializations(dt_s: float | None = None) -> dict[str, FlightJob]:
    """Section 5.2.1: one flight for each transfer time."""
    jobs = {}
    for periods in TRANSFER_PERIODS:
        scenario = scenarios.initialization(periods, dt_s)
        jobs[f"initialization {periods:g}"] = FlightJob(scenario, (INITIALIZATION,), (0,), guide="straight_line")
    return jobs


def keepings(seeds: tuple[int, ...], dt_s: float | None = None, periods: float = 10.0) -> dict[str, FlightJob]:
    """Sections 5.2.2 and 5.2.3: keeping the space circle, with and without failure."""
    keeping = scenarios.keeping(periods, dt_s)
    failure = scenarios.keeping_failure(periods, dt_s=dt_s)
    return {
        "keeping": replace(_long(printed(keeping), KEEPING, seeds), measured=True),
        "corrected": _long(keeping, CORRECTED, seeds),
        "failure": replace(_long(printed(failure), FAILURE, seeds), measured=True),
    }


def reconfigurations(seeds: tuple[int, ...], dt_s: float | None = None) -> dict[str, FlightJob]:
    """Section 5.2.4: from the following orbit to the projected circle, from better and worse starts."""
    near = printed(scenarios.reconfiguration(dt_s=dt_s))
    far = printed(scenarios.reconfiguration(FAR_ENTRY, dt_s=dt_s))
    slow, fast = (
        tuple(scenarios.with_velocity(near, velocity)) for velocity in (SMALL_VELOCITY_M_S, LARGE_VELOCITY_M_S)
    )
    laws = (RECONFIGURATION,)
    return {
        "small position error": FlightJob(near, laws, seeds),
        "large position error": FlightJob(far, laws, seeds),
        "small velocity error": FlightJob(near, laws, seeds, start=slow),
        "large velocity error": FlightJob(near, laws, seeds, start=fast),
    }


def _long(scenario: Scenario, laws: tuple[Law, ...], seeds: tuple[int, ...]) -> FlightJob:
    """Job of a long scenario, of which not every step is recorded."""
    return FlightJob(scenario, laws, seeds, every=max(1, round(RECORD_INTERVAL_S / scenario.dt_s)))
