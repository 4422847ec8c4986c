"""Sections 5.2.4 and 5.2.5: the reconfiguration and the full mission."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from baselines.thesis import plan, scenarios
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.flights import Deck, Effort, as_printed, deal, error_state
from baselines.thesis.claims.verdict import Between, Statement
from baselines.thesis.flights import Flights
from baselines.thesis.jobs import Job
from formation_env.numerics.arrays import Array

LAWS = {"quick": error_state(plan.MANEUVER_S2)}
"""With the weight that the figures' thrust asks for."""

VELOCITY_M_S = (0.0, 1.0, 0.0)
"""A following flight that is not at rest, for Figures 5.23 and 5.24."""
ARRIVED_M = 300.0
ARRIVAL_PERIODS = 0.4
"""Time of the reconfiguration, in periods."""


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

    near: Deck
    far: Deck
    moving: Deck
    resting: Deck
    mission: Deck
    mission_far: Deck


def jobs(effort: Effort) -> dict[str, Job]:
    """All of them, with noise; the names are `Maneuvers`' fields."""
    near = as_printed(scenarios.reconfiguration(periods=ARRIVAL_PERIODS, dt_s=effort.dt_s), effort)
    far = as_printed(scenarios.reconfiguration(plan.FAR_ENTRY, periods=ARRIVAL_PERIODS, dt_s=effort.dt_s), effort)
    mission_far = as_printed(scenarios.mission(effort.coarse_dt_s), effort)
    first, second = mission_far.phases
    mission = replace(mission_far, phases=(first, replace(second, formation=plan.FAR_ENTRY)))
    resting = deal(LAWS, near, effort)
    return {
        "near": resting,
        "far": deal(LAWS, far, effort),
        "moving": replace(resting, start=tuple(scenarios.with_velocity(near, VELOCITY_M_S))),
        "resting": replace(resting, start=tuple(scenarios.with_velocity(near, (0.0, 0.0, 0.0)))),
        "mission": deal(LAWS, mission, effort),
        "mission_far": deal(LAWS, mission_far, effort),
    }


def maneuvers(flown: Mapping[str, Flights]) -> Maneuvers:
    """Those flights by name."""
    return Maneuvers(**{field.name: Deck(tuple(LAWS), flown[field.name]) for field in fields(Maneuvers)})


def claims(flown: Maneuvers, effort: Effort) -> list[Claim]:
    """The claims of sections 5.2.4 and 5.2.5."""
    return [
        *_reconfiguration(flown, assumption_of(effort, effort.dt_s)),
        *_windows(flown, assumption_of(effort, effort.dt_s)),
        *_mission(flown, assumption_of(effort, effort.coarse_dt_s)),
    ]


def assumption_of(effort: Effort, dt_s: float) -> str:
    """What the verdicts on maneuvers rest on."""
    return (
        f"T = {dt_s:g} s, {effort.maneuver_assumption}; error-state law; a = {plan.MANEUVER_S2:g}, since the thesis "
        "prints no weight for its maneuvers"
    )


def _reconfiguration(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.near.flights, flown.near.row("quick")
    why = (
        "a = 1500 is the weight that gives the figure's thrust: |u| begins at K (x_d - x) with 1676 m and 4 m/s to go."
    )

    def say(sentence: str, said: str, quantity: str, wanted: Between, explanation: str = why) -> Statement:
        return Statement("5.2.4", sentence, said, quantity, wanted, assumption, explanation)

    settled = say(
        "the maneuver time is about 0.4 p",
        "0.4 p",
        "the error stays below 300 m from {} p on",
        Between(0.3, 0.5),
        "A law with the figure's thrust has a bandwidth n^(1/2) a^(-1/4) of 5e-3 rad/s and is there within a tenth of "
        "a period; 0.4 p is rather the time that was flown than the time that was needed.",
    )
    return [
        say("Figure 5.20: control acceleration", "< 0.06 m/s^2", "max |u| {} m/s^2", Between(high=0.06)).judge(
            flights.max_accel()[quick]
        ),
        say("Figure 5.20: position error", "< 2000 m", "max error {} m", Between(high=2000.0)).judge(
            flights.max_error()[quick]
        ),
        settled.judge(_settled_periods(flights, quick)),
    ]


def _settled_periods(flights: Flights, law: int) -> Array:
    """Time (seeds,) from which on the error stays below `ARRIVED_M`, in periods."""
    far = flights.position_error_m[:, law] > ARRIVED_M
    last = len(far) - 1 - far[::-1].argmax(axis=0)
    return np.asarray(flights.time_s[last] / flights.scenario.orbit.period_s)


def _windows(flown: Maneuvers, assumption: str) -> list[Claim]:
    quick = flown.near.row("quick")

    def say(sentence: str, said: str, quantity: str, explanation: str) -> Statement:
        return Statement("5.2.4", sentence, said, quantity, Between(low=0.0), assumption, explanation)

    offset = say(
        "maneuver window: the entry point should be as close as possible to the maneuver point",
        "a far entry costs more",
        "entry 8.3 km away in place of 1.7 km: {} m/s more",
        "The law spends in proportion to the distance that it sees. It holds for a law that is given no path; "
        "two planned impulses would pay for the difference of the orbits, not of the places.",
    )
    velocity = say(
        "relatively stationary state is best for maneuver",
        "an initial velocity costs more",
        "1 m/s along the track at the start: {} m/s more",
        "The velocity has to be undone, unless it points where the maneuver goes; the thesis varies one of them only.",
    )
    near, far = flown.near.flights.delta_v(), flown.far.flights.delta_v()
    return [
        offset.judge(far[quick] - near[quick]),
        velocity.judge((flown.moving.flights.delta_v() - flown.resting.flights.delta_v())[quick]),
    ]


def _mission(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.mission.flights, flown.mission.row("quick")
    why = (
        "The greatest errors and thrusts are those at the beginning of the two phases, where the desired path "
        "jumps. The thesis does not print the entry point of this mission; that of section 5.2.4 lies 4.9 km "
        "from the follower after 5.05 periods and gives 5.0 km, its opposite lies 2.8 km away and gives the "
        "figure."
    )

    entered = f"{assumption}; the circle is entered at [0, -3324, 0, -1.8, 0, -3.6]"

    def say(sentence: str, said: str, quantity: str, wanted: Between, explanation: str = why) -> Statement:
        return Statement("5.2.5", sentence, said, quantity, wanted, entered, explanation)

    return [
        say("Figure 5.25: position error", "< 4000 m", "max error {} m", Between(high=4000.0)).judge(
            flights.max_error()[quick]
        ),
        say("Figure 5.25: control acceleration", "< 0.1 m/s^2", "max |u| {} m/s^2", Between(high=0.1)).judge(
            flights.max_accel()[quick]
        ),
        say(
            "the starting point of each phase should be as close as possible",
            "a far entry costs more",
            "entry 4.9 km away in place of 2.8 km: {} m/s more",
            Between(low=0.0),
            "The law spends in proportion to the jump of the desired path.",
        ).judge((flown.mission_far.flights.delta_v() - flights.delta_v())[quick]),
    ]
