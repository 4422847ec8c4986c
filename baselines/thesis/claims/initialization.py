"""Section 5.2.1: the following initialization, without noise, so that one flight decides."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from baselines.design.transfers import two_impulse
from baselines.thesis import figure_flights
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.shared_flights import ClaimOptions
from baselines.thesis.claims.verdict import Between, Statement
from baselines.thesis.recorded_flights import Flights
from formation_env.dynamics.base import DiscreteModel
from formation_env.dynamics.hcw import transition_matrix

HALF, TENTH = 0.5, 0.1
_WHY_LAG = (
    "The quasi-static tracking law ignores the velocity of the desired path, so the follower lags by a constant "
    "distance along the line."
)


def by_time(flown: Mapping[str, Flights]) -> dict[float, Flights]:
    """The flights of `figure_flights.initializations` by transfer time in periods."""
    return {periods: flown[f"initialization {periods:g}"] for periods in figure_flights.TRANSFER_PERIODS}


def claims(flights: Mapping[float, Flights], options: ClaimOptions) -> list[Claim]:
    """The claims of section 5.2.1 and those that chapter 6 repeats from it."""
    assumption = f"T = {options.dt_s:g} s, no noise, so no interval; Q = I, R = 0.5 I / n^2, quasi-static tracker"
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
    for sentence, thesis_value, quantity, limit, flown, kind in rows:
        statement = Statement(
            section="5.2.1",
            sentence=sentence,
            thesis_value=thesis_value,
            quantity=quantity,
            expected=Between(high=limit),
            assumption=assumption,
            explanation=_WHY_LAG,
        )
        values = flown.max_error() if kind == "error" else flown.max_accel()
        claims.append(statement.decide(values[0]))
    return claims


def _comparisons(flights: Mapping[float, Flights], assumption: str) -> list[Claim]:
    half, tenth = flights[HALF], flights[TENTH]
    statement = partial(Statement, section="5.2.1", assumption=assumption)
    delta_v = statement(
        sentence="with t_f = 0.1 p more control effort is needed",
        thesis_value="delta-v ratio > 1",
        quantity="delta-v at 0.1 p is {} times that at 0.5 p",
        expected=Between(low=1.0),
        explanation=(
            "The line is followed five times faster, and starting and stopping each cost its speed; compensating the "
            "Coriolis acceleration costs 2 n times 2000 m at any speed."
        ),
    )
    accuracy = statement(
        sentence="the control accuracy decreases if control parameters keep the same",
        thesis_value="error ratio > 1",
        quantity="max error at 0.1 p is {} times that at 0.5 p",
        expected=Between(low=1.0),
        explanation="The lag is proportional to the speed along the line.",
    )
    axis = statement(
        sentence="the y-axis thrust pulse at the beginning is to accelerate the spacecraft",
        thesis_value="y-axis first and largest",
        quantity="largest |u_y| comes {} of the transfer time after the start",
        expected=Between(high=0.1),
        explanation=(
            "The pulse ends when the follower has the line's speed; the x-axis thrust against the Coriolis "
            "acceleration remains."
        ),
    )
    peak = int(np.abs(half.thrust_m_s2[:, 0, 0, 1]).argmax())
    return [
        delta_v.decide(tenth.delta_v()[0] / half.delta_v()[0]),
        accuracy.decide(tenth.max_error()[0] / half.max_error()[0]),
        axis.decide(np.array([peak / len(half.steps)])),
    ]


def _times(flights: Mapping[float, Flights], assumption: str) -> list[Claim]:
    times = sorted(flights)
    cost = np.array([flights[t].delta_v()[0, 0] for t in times])
    error = np.array([flights[t].max_error()[0, 0] for t in times])
    short = Statement(
        section="5.2.1",
        sentence="the control cost for shortening the transfer time is too high when t_f <= 0.1 p",
        thesis_value="0.1 p costs more than its gain",
        quantity="delta-v falls by {} m/s from 0.1 p to 0.2 p, more than from there to 1.4 p",
        expected=Between(low=float(cost[times.index(0.2)] - cost[-1])),
        assumption=assumption,
        explanation=(
            "Delta-v is about 2 n y_f + 2 y_f / t_f, so doubling the time once saves half of the avoidable part."
        ),
    )
    window = Statement(
        section="5.2.1",
        sentence="the optimal initialization time is between 0.2 p and 0.8 p",
        thesis_value="0.2 p to 0.8 p",
        quantity="the transfer time of least delta-v and of least error is {} p",
        expected=Between(low=0.2, high=0.8),
        assumption=f"{assumption}; 0.1 p to 1.4 p",
        explanation=(
            "Error and delta-v decrease monotonically with the transfer time, so the lower end is a matter of cost and "
            "the upper end arbitrary: no quantity in the thesis gets worse beyond 0.8 p."
        ),
    )
    best = times[int(cost.argmin())] if cost.argmin() == error.argmin() else times[int(error.argmin())]
    first = np.array([cost[times.index(0.1)] - cost[times.index(0.2)]])
    return [short.decide(first), window.decide(np.array([best])), _hohmann(flights[HALF], assumption)]


def _hohmann(half: Flights, assumption: str) -> Claim:
    """Compare the straight line with the cheapest two impulses in the same time."""
    statement = Statement(
        section="6.1",
        sentence="when its transfer time equals 0.5 p, the straight line turned out to be a Hohmann transfer",
        thesis_value="delta-v ratio 1",
        quantity="the line takes {} times the delta-v of two impulses in the same time",
        expected=Between(low=0.9, high=1.1),
        assumption=assumption,
        explanation=(
            "A Hohmann transfer coasts between its impulses; on the line the follower thrusts against the Coriolis "
            "acceleration all the way. In the inertial frame the path only resembles an ellipse of the same duration."
        ),
    )
    time_s, n = float(half.time_s[-2]), half.scenario.orbit.mean_motion_rad_s
    coast = DiscreteModel(transition_matrix(n, time_s), np.zeros((6, 3)), np.zeros(6))
    impulses = two_impulse(coast, time_s, n, np.zeros(6), half.desired[-1])
    return statement.decide(half.delta_v()[0] / impulses.delta_v_m_s)
