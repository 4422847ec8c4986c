"""Sections 5.2.4 and 5.2.5: the reconfiguration and the full mission."""

from dataclasses import dataclass, replace

import numpy as np

from baselines.thesis import scenarios
from baselines.thesis.claim import Claim
from baselines.thesis.claims_flights import A_MANEUVER_S2, Deck, Effort, as_printed, deal, error_state
from baselines.thesis.claims_verdict import Between, Statement
from baselines.thesis.flights import Flights, fly
from formation_env.formations import ProjectedCircle
from formation_env.seeds import seeds

LAWS = {"printed": error_state(), "quick": error_state(A_MANEUVER_S2)}
"""With the keeping's weight, and with the one that the figures' thrust asks for."""

FAR = ProjectedCircle(x0_m=0.0, vx0_m_s=0.9)
"""An entry point half as far from the leader, so 3338 m from the follower in place of 1676 m (Figure 5.22)."""
SAME_SIDE = ProjectedCircle(x0_m=0.0, vx0_m_s=-1.8)
"""The thesis's circle, entered half an orbit later: 2.8 km from the follower after 5.05 periods, in place of 4.9 km."""
VELOCITY_M_S = (0.0, 1.0, 0.0)
"""A following flight that is not at rest, for Figures 5.23 and 5.24."""
ARRIVED_M = 300.0


@dataclass(frozen=True)
class Maneuvers:
    """Flights of sections 5.2.4 and 5.2.5.

    Attributes:
        near: to the thesis's entry point.
        far: to `FAR`.
        moving: to the thesis's entry point, with a relative velocity at the start.
        resting: the same as `near`, from the exact start as in `moving`.
        mission: section 5.2.5, with the entry point on the follower's side of the leader.
        mission_far: the same with the entry point of section 5.2.4, which is on the other side then.
    """

    near: Deck
    far: Deck
    moving: Flights
    resting: Flights
    mission: Deck
    mission_far: Deck


def maneuvers(effort: Effort) -> Maneuvers:
    """Fly them all, with noise."""
    near = as_printed(scenarios.reconfiguration(periods=1.0, dt_s=effort.dt_s), effort)
    far = as_printed(scenarios.reconfiguration(FAR, periods=1.0, dt_s=effort.dt_s), effort)
    mission_far = as_printed(scenarios.mission(effort.coarse_dt_s), effort)
    first, second = mission_far.phases
    mission = replace(mission_far, phases=(first, replace(second, formation=SAME_SIDE)))

    def given(velocity_m_s: tuple[float, float, float]) -> Flights:
        start = scenarios.with_velocity(near, velocity_m_s)
        return fly([LAWS["quick"](near)], near, seeds("test", effort.seeds), every=60, start=start)

    return Maneuvers(
        near=deal(LAWS, near, effort),
        far=deal(LAWS, far, effort),
        moving=given(VELOCITY_M_S),
        resting=given((0.0, 0.0, 0.0)),
        mission=deal(LAWS, mission, effort),
        mission_far=deal(LAWS, mission_far, effort),
    )


def claims(flown: Maneuvers, effort: Effort) -> list[Claim]:
    """The claims of sections 5.2.4 and 5.2.5."""
    return [
        *_reconfiguration(flown, _assumption(effort, effort.dt_s, 1)),
        *_windows(flown, _assumption(effort, effort.dt_s, 1)),
        *_mission(flown, _assumption(effort, effort.coarse_dt_s, 10)),
    ]


def _assumption(effort: Effort, dt_s: float, periods: int) -> str:
    words = replace(effort, dt_s=dt_s, periods=periods).assumption
    return f"{words}; error-state law; a = {A_MANEUVER_S2:g}, since the thesis prints no weight for its maneuvers"


def _reconfiguration(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.near.flights, flown.near.row("quick")
    why = "a = 1300 is the weight that gives the figure's thrust: |u| begins at K (x_d - x) with 1676 m and 4 m/s to go."

    def say(sentence: str, said: str, quantity: str, wanted: Between, explanation: str = why) -> Statement:
        return Statement("5.2.4", sentence, said, quantity, wanted, assumption, explanation)

    settled = say(
        "the maneuver time is about 0.4 p",
        "0.4 p",
        "the error stays below 300 m from {} p on",
        Between(high=0.4),
        "The law's bandwidth n^(1/2) a^(-1/4), 5e-3 rad/s, sets the time, not the orbit; the far bound of 0.4 p is kept with room.",
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


def _settled_periods(flights: Flights, law: int) -> np.ndarray:
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
        "entry 3338 m away in place of 1676 m: {} m/s more",
        "The law spends in proportion to the distance that it sees. It holds for a law that is given no path; two planned "
        "impulses would pay for the difference of the orbits, not of the places.",
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
        velocity.judge(flown.moving.delta_v()[0] - flown.resting.delta_v()[0]),
    ]


def _mission(flown: Maneuvers, assumption: str) -> list[Claim]:
    flights, quick = flown.mission.flights, flown.mission.row("quick")
    why = (
        "The greatest errors and thrusts are those at the beginning of the two phases, where the desired path jumps. The "
        "thesis does not print the entry point of this mission; that of section 5.2.4 lies 4.9 km from the follower after "
        "5.05 periods and gives 5.0 km, its opposite lies 2.8 km away and gives the figure."
    )

    def say(sentence: str, said: str, quantity: str, wanted: Between, explanation: str = why) -> Statement:
        return Statement("5.2.5", sentence, said, quantity, wanted, assumption, explanation)

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
