"""Sections 5.2.4 and 5.2.5: the reconfiguration and the full mission."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from baselines.thesis import figure_flights, scenarios
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.shared_flights import ClaimOptions, LawFlights, as_printed, error_state, make_job
from baselines.thesis.claims.verdict import Between, Statement
from baselines.thesis.flight_job import FlightJob
from baselines.thesis.recorded_flights import Flights
from formation_env.numerics.arrays import Array

LAWS = {"quick": error_state(figure_flights.MANEUVER_S2)}
"""Laws of the maneuvers, with the weight that reproduces the figures' thrust."""

VELOCITY_M_S = (0.0, 1.0, 0.0)
"""Initial velocity relative to the following orbit, for Figures 5.23 and 5.24, m/s."""
ARRIVED_M = 300.0
ARRIVAL_PERIODS = 0.4
"""Duration of the reconfiguration, in periods."""


@dataclass(frozen=True)
class Maneuvers:
    """Flights of sections 5.2.4 and 5.2.5.

    Attributes:
        near: to the thesis's entry point.
        far: to the opposite point of the circle, 8.3 km from the follower in place of 1.7 km.
        moving: to the thesis's entry point, with a relative velocity at the start.
        resting: the same as `near`, from the exact start as in `moving`.
        mission: section 5.2.5, with the entry point on the follower's side of the leader.
        mission_far: the same with the entry point of section 5.2.4, which is on the other side then.
    """

    near: LawFlights
    far: LawFlights
    moving: LawFlights
    resting: LawFlights
    mission: LawFlights
    mission_far: LawFlights


def maneuver_jobs(options: ClaimOptions) -> dict[str, FlightJob]:
    """All jobs of the maneuvers, with noise; the names are the fields of `Maneuvers`."""
    near = as_printed(scenarios.reconfiguration(periods=ARRIVAL_PERIODS, dt_s=options.dt_s), options)
    far = as_printed(
        scenarios.reconfiguration(figure_flights.FAR_ENTRY, periods=ARRIVAL_PERIODS, dt_s=options.dt_s), options
    )
    mission_far = as_printed(scenarios.mission(options.coarse_dt_s), options)
    first, second = mission_far.phases
    mission = replace(mission_far, phases=(first, replace(second, formation=figure_flights.FAR_ENTRY)))
    resting = make_job(LAWS, near, options)
    return {
        "near": resting,
        "far": make_job(LAWS, far, options),
        "moving": replace(resting, start=tuple(scenarios.with_velocity(near, VELOCITY_M_S))),
        "resting": replace(resting, start=tuple(scenarios.with_velocity(near, (0.0, 0.0, 0.0)))),
        "mission": make_job(LAWS, mission, options),
        "mission_far": make_job(LAWS, mission_far, options),
    }


def maneuvers(flown: Mapping[str, Flights]) -> Maneuvers:
    """Flights of the jobs of `maneuver_jobs`."""
    return Maneuvers(**{field.name: LawFlights(tuple(LAWS), flown[field.name]) for field in fields(Maneuvers)})


def claims(flown: Maneuvers, options: ClaimOptions) -> list[Claim]:
    """The claims of sections 5.2.4 and 5.2.5."""
    return [
        *_reconfiguration(flown, assumption_of(options, options.dt_s)),
        *_windows(flown, assumption_of(options, options.dt_s)),
        *_mission(flown, assumption_of(options, options.coarse_dt_s)),
    ]


def assumption_of(options: ClaimOptions, dt_s: float) -> str:
    """Assumption of the verdicts on maneuvers."""
    return (
        f"T = {dt_s:g} s, {options.maneuver_assumption}; error-state law; a = {figure_flights.MANEUVER_S2:g}, since "
        "the thesis gives no weight for its maneuvers"
    )


def _reconfiguration(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.near.flights, flown.near.row("quick")
    why = (
        "a = 1500 is the weight that gives the figure's thrust: initially |u| = |K (x_d - x)| with 1676 m and 4 m/s to "
        "go."
    )

    statement = partial(Statement, section="5.2.4", assumption=assumption, explanation=why)

    settled = statement(
        sentence="the maneuver time is about 0.4 p",
        thesis_value="0.4 p",
        quantity="the error stays below 300 m from {} p on",
        expected=Between(0.3, 0.5),
        explanation=(
            "A law with the figure's thrust has a bandwidth n^(1/2) a^(-1/4) of 5e-3 rad/s and arrives within a tenth "
            "of a "
            "period; 0.4 p is the simulated time rather than the time needed."
        ),
    )
    return [
        statement(
            sentence="Figure 5.20: control acceleration",
            thesis_value="< 0.06 m/s^2",
            quantity="max |u| {} m/s^2",
            expected=Between(high=0.06),
        ).decide(flights.max_accel()[quick]),
        statement(
            sentence="Figure 5.20: position error",
            thesis_value="< 2000 m",
            quantity="max error {} m",
            expected=Between(high=2000.0),
        ).decide(flights.max_error()[quick]),
        settled.decide(_settled_periods(flights, quick)),
    ]


def _settled_periods(flights: Flights, law: int) -> Array:
    """Time (seeds,) after which the error stays below `ARRIVED_M`, in periods."""
    far = flights.position_error_m[:, law] > ARRIVED_M
    last = len(far) - 1 - far[::-1].argmax(axis=0)
    return np.asarray(flights.time_s[last] / flights.scenario.orbit.period_s)


def _windows(flown: Maneuvers, assumption: str) -> list[Claim]:
    quick = flown.near.row("quick")

    statement = partial(Statement, section="5.2.4", expected=Between(low=0.0), assumption=assumption)

    offset = statement(
        sentence="maneuver window: the entry point should be as close as possible to the maneuver point",
        thesis_value="a far entry costs more",
        quantity="entry 8.3 km away in place of 1.7 km: {} m/s more",
        explanation=(
            "The law's delta-v is proportional to the initial distance. This holds for a law without guidance; two "
            "planned "
            "impulses would pay for the difference of the orbits, not of the positions."
        ),
    )
    velocity = statement(
        sentence="relatively stationary state is best for maneuver",
        thesis_value="an initial velocity costs more",
        quantity="1 m/s along the track at the start: {} m/s more",
        explanation=(
            "The velocity must be cancelled, unless it points along the maneuver; the thesis varies only one of them."
        ),
    )
    near, far = flown.near.flights.delta_v(), flown.far.flights.delta_v()
    return [
        offset.decide(far[quick] - near[quick]),
        velocity.decide((flown.moving.flights.delta_v() - flown.resting.flights.delta_v())[quick]),
    ]


def _mission(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.mission.flights, flown.mission.row("quick")
    why = (
        "The maximum errors and thrusts occur at the beginning of the two phases, where the desired path jumps. The "
        "thesis does not give the entry point of this mission; that of section 5.2.4 is 4.9 km from the follower after "
        "5.05 periods and gives 5.0 km, the opposite point is 2.8 km away and gives the figure."
    )

    entered = f"{assumption}; the circle is entered at [0, -3324, 0, -1.8, 0, -3.6]"

    statement = partial(Statement, section="5.2.5", assumption=entered, explanation=why)

    return [
        statement(
            sentence="Figure 5.25: position error",
            thesis_value="< 4000 m",
            quantity="max error {} m",
            expected=Between(high=4000.0),
        ).decide(flights.max_error()[quick]),
        statement(
            sentence="Figure 5.25: control acceleration",
            thesis_value="< 0.1 m/s^2",
            quantity="max |u| {} m/s^2",
            expected=Between(high=0.1),
        ).decide(flights.max_accel()[quick]),
        statement(
            sentence="the starting point of each phase should be as close as possible",
            thesis_value="a far entry costs more",
            quantity="entry 4.9 km away in place of 2.8 km: {} m/s more",
            expected=Between(low=0.0),
            explanation="The law's delta-v is proportional to the jump of the desired path.",
        ).decide((flown.mission_far.flights.delta_v() - flights.delta_v())[quick]),
    ]
