"""Section 5.2.1: the following initialization, without noise, so that one flight decides."""

from collections.abc import Mapping

import numpy as np

from baselines.design.transfers import two_impulse
from baselines.thesis import plan
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.flights import Effort
from baselines.thesis.claims.verdict import Between, Statement
from baselines.thesis.flights import Flights
from formation_env.dynamics.base import DiscreteModel
from formation_env.dynamics.hcw import transition_matrix

HALF, TENTH = 0.5, 0.1
_WHY_LAG = (
    "The desired path has no velocity for the law to follow, which is the quasi-static tracker to the last "
    "digit, so the follower lags by a constant distance while the line goes on."
)


def by_time(flown: Mapping[str, Flights]) -> dict[float, Flights]:
    """The flights of `plan.initializations` by transfer time in periods."""
    return {periods: flown[f"initialization {periods:g}"] for periods in plan.TRANSFER_PERIODS}


def claims(flights: Mapping[float, Flights], effort: Effort) -> list[Claim]:
    """The claims of section 5.2.1 and those that chapter 6 repeats from it."""
    assumption = f"T = {effort.dt_s:g} s, no noise, so no interval; Q = I, R = 0.5 I / n^2, quasi-static tracker"
    return [*_accuracies(flights, assumption), *_comparisons(flights, assumption), *_times(flights, assumption)]


def _accuracies(flights: Mapping[float, Flights], assumption: str) -> list[Claim]:
    half, tenth = flights[HALF], flights[TENTH]
    rows = [
        (
            "position error not greater than 30 m (t_f = 0.5 p)",
            "< 30 m",
            "max error {} m",
            30.0,
            half,
            "error",
        ),
        ("Figure 5.2: control acceleration, t_f = 0.5 p", "< 0.02 m/s^2", "max |u| {} m/s^2", 0.02, half, "accel"),
        ("Figure 5.3: position error, t_f = 0.1 p", "< 150 m", "max error {} m", 150.0, tenth, "error"),
        ("Figure 5.3: control acceleration, t_f = 0.1 p", "< 0.08 m/s^2", "max |u| {} m/s^2", 0.08, tenth, "accel"),
    ]
    claims = []
    for sentence, said, quantity, limit, flown, kind in rows:
        statement = Statement("5.2.1", sentence, said, quantity, Between(high=limit), assumption, _WHY_LAG)
        values = flown.max_error() if kind == "error" else flown.max_accel()
        claims.append(statement.judge(values[0]))
    return claims


def _comparisons(flights: Mapping[float, Flights], assumption: str) -> list[Claim]:
    half, tenth = flights[HALF], flights[TENTH]
    effort = Statement(
        "5.2.1",
        "with t_f = 0.1 p more control effort is needed",
        "delta-v ratio > 1",
        "delta-v at 0.1 p is {} times that at 0.5 p",
        Between(low=1.0),
        assumption,
        "The line is gone along five times faster, and starting and stopping cost its speed twice; the Coriolis "
        "force costs the same 2 n times 2000 m at any speed.",
    )
    accuracy = Statement(
        "5.2.1",
        "the control accuracy decreases if control parameters keep the same",
        "error ratio > 1",
        "max error at 0.1 p is {} times that at 0.5 p",
        Between(low=1.0),
        assumption,
        "The lag is proportional to the speed along the line.",
    )
    axis = Statement(
        "5.2.1",
        "the y-axis thrust pulse at the beginning is to accelerate the spacecraft",
        "y-axis first and largest",
        "largest |u_y| comes {} of the transfer time after the start",
        Between(high=0.1),
        assumption,
        "The pulse is over when the follower moves as fast as the line; what remains is the x-axis thrust "
        "against the Coriolis force.",
    )
    peak = int(np.abs(half.thrust_m_s2[:, 0, 0, 1]).argmax())
    return [
        effort.judge(tenth.delta_v()[0] / half.delta_v()[0]),
        accuracy.judge(tenth.max_error()[0] / half.max_error()[0]),
        axis.judge(np.array([peak / len(half.steps)])),
    ]


def _times(flights: Mapping[float, Flights], assumption: str) -> list[Claim]:
    times = sorted(flights)
    cost = np.array([flights[t].delta_v()[0, 0] for t in times])
    error = np.array([flights[t].max_error()[0, 0] for t in times])
    short = Statement(
        "5.2.1",
        "the control cost for shortening the transfer time is too high when t_f <= 0.1 p",
        "0.1 p costs more than its gain",
        "delta-v falls by {} m/s from 0.1 p to 0.2 p, more than from there to 1.4 p",
        Between(low=float(cost[times.index(0.2)] - cost[-1])),
        assumption,
        "Delta-v is about 2 n y_f + 2 y_f / t_f, so half of the avoidable part is saved by the first doubling.",
    )
    window = Statement(
        "5.2.1",
        "the optimal initialization time is between 0.2 p and 0.8 p",
        "0.2 p to 0.8 p",
        "the transfer time of least delta-v and of least error is {} p",
        Between(low=0.2, high=0.8),
        f"{assumption}; 0.1 p to 1.4 p",
        "Error and delta-v fall with the transfer time all the way, so the lower end is a matter of price and "
        "the upper end is set by patience: nothing in the thesis's measures gets worse beyond 0.8 p.",
    )
    best = times[int(cost.argmin())] if cost.argmin() == error.argmin() else times[int(error.argmin())]
    first = np.array([cost[times.index(0.1)] - cost[times.index(0.2)]])
    return [short.judge(first), window.judge(np.array([best])), _hohmann(flights[HALF], assumption)]


def _hohmann(half: Flights, assumption: str) -> Claim:
    """The straight line against the cheapest two impulses in the same time."""
    statement = Statement(
        "6.1",
        "when its transfer time equals 0.5 p, the straight line turned out to be a Hohmann transfer",
        "delta-v ratio 1",
        "the line takes {} times the delta-v of two impulses in the same time",
        Between(low=0.9, high=1.1),
        assumption,
        "A Hohmann transfer coasts between its impulses; on the line the follower thrusts against the Coriolis "
        "force all the way, and in the inertial frame it only looks like an ellipse of the same duration.",
    )
    time_s, n = float(half.time_s[-2]), half.scenario.orbit.mean_motion_rad_s
    coast = DiscreteModel(transition_matrix(n, time_s), np.zeros((6, 3)), np.zeros(6))
    impulses = two_impulse(coast, time_s, n, np.zeros(6), half.desired[-1])
    return statement.judge(half.delta_v()[0] / impulses.delta_v_m_s)
