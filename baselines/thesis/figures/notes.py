"""Outcome of each figure in a sentence or two, with the numbers of its flights."""

from collections.abc import Callable
from typing import Final

import numpy as np

from baselines.report.text import number
from baselines.thesis import figure_flights
from baselines.thesis.figures.drawings import (
    CORRECTED_LQR,
    CORRECTED_TRACKING,
    FAILED_LQR,
    FAILED_SMC,
    LQR,
    SMC,
    TIGHTER,
    Flown,
)
from baselines.thesis.recorded_flights import Flights

MEASUREMENTS: Final = "At a sigma of 2 m the measurements lie on the true position. "
READING: Final = "On the dynamics as printed, k of eq. (2.62) without its n, "


def _accel(flights: Flights, policy: int) -> str:
    """Text of the maximum acceleration, mean over the seeds."""
    return f"{1e3 * flights.max_accel()[policy].mean():.3g} mm/s²"


def _mean(flights: Flights, policy: int) -> str:
    """Text of the mean error, mean over the seeds."""
    return f"{number(flights.mean_error()[policy].mean())} m"


def _max(flights: Flights, policy: int) -> str:
    """Text of the maximum error, mean over the seeds."""
    return f"{number(flights.max_error()[policy].mean())} m"


def _spent(flights: Flights, policy: int) -> str:
    """Text of the delta-v, mean over the seeds."""
    return f"{number(flights.delta_v()[policy].mean())} m/s"


def _in_track(flown: Flown) -> str:
    return (
        "Eq. (3.7-3.9) are of first order in the ratio of the Earth's rate to the orbit's: the ground tracks coincide "
        "to 3 % of the miss of the following formation with the same separation."
    )


def _initialization(periods: str, printed: str) -> Callable[[Flown], str]:
    def note(flown: Flown) -> str:
        flights = flown[f"initialization {periods}"]
        return (
            f"The trajectory-following regulator errs by {_max(flights, 0)} at most, with {_accel(flights, 0)}; "
            f"{printed}. The error is the lag of eq. (4.19), which treats the moving desired state as constant."
        )

    return note


def _transfer_times(flown: Flown) -> str:
    shortest, middle = flown["initialization 0.1"], flown["initialization 0.4"]
    return (
        f"Both are inversely proportional to the transfer time: {_max(shortest, 0)} and {_accel(shortest, 0)} at 0.1 "
        "periods, "
        f"{_max(middle, 0)} and {_accel(middle, 0)} at 0.4. Neither quantity speaks against more than 0.8 periods."
    )


def _estimation(flown: Flown) -> str:
    keeping = flown["keeping"]
    after = keeping.time_s > keeping.scenario.orbit.period_s
    misses = np.linalg.norm((keeping.estimate - keeping.truth)[after, LQR, 0, :3], axis=-1)
    return (
        f"After the first period the estimated position is in error by {number(float(np.sqrt((misses**2).mean())))} m "
        f"(root mean square). {MEASUREMENTS}Cross-track the follower lags the desired path, which Figure 5.7 explains."
    )


def _keeping(flown: Flown) -> str:
    printed, corrected = flown["keeping"], flown["corrected"]
    share = 100 * (printed.effort()[LQR, :, 2] / printed.effort()[LQR].sum(axis=-1)).mean()
    return (
        f"{READING}error-state LQR with the printed weights errs by {_max(printed, LQR)} at most with "
        f"{_accel(printed, LQR)}, {share:.3g} % of the effort across the plane: the thesis's numbers, but no "
        f"spacecraft moves like this. With k's n the same law errs by {_mean(corrected, CORRECTED_LQR)} in the mean "
        f"and spends {_spent(corrected, CORRECTED_LQR)} in place of {_spent(printed, LQR)}; the trajectory-following "
        f"law of eq. (4.17-4.19) errs by {_mean(corrected, CORRECTED_TRACKING)}."
    )


def _tighter(flown: Flown) -> str:
    return (
        f"With a = {figure_flights.TIGHTER.control_s2:g} in place of 12000 the greatest error is "
        f"{_max(flown['keeping'], TIGHTER)}."
    )


def _sweep(flown: Flown) -> str:
    return (
        f"Each point is a weight a I / n² with a from {min(figure_flights.SWEEP_S2):g} to "
        f"{max(figure_flights.SWEEP_S2):g}. {READING}"
        "consumption is proportional to time and nearly independent of accuracy: it compensates the wrong cross-track "
        "frequency. The thesis's axis ends at 40; its unit, m/s², suggests a sum of acceleration samples, which equals "
        "m/s only if they are 1 s apart."
    )


def _failure(flown: Flown) -> str:
    greatest = number(flown["failure"].max_error()[FAILED_LQR, 0])
    return (
        f"On this seed the error grows to {greatest} m. How far depends on the initial error, which the thesis does "
        "not state (here 50 m and 0.05 m/s on each axis, 1 sigma)."
    )


def _with_and_without(flown: Flown) -> str:
    failure, keeping = flown["failure"], flown["keeping"]
    after_1, after_all = (
        100 * (failure.mean_error(end)[FAILED_LQR].mean() / keeping.mean_error(end)[LQR].mean() - 1)
        for end in (1, None)
    )
    return (
        f"The mean error is {after_1:.3g} % larger after one period and {after_all:.3g} % larger after all; means over "
        f"{len(keeping.seeds)} seeds."
    )


def _smc(flown: Flown) -> str:
    keeping = flown["keeping"]
    return (
        f"{READING}the greatest error is {_max(keeping, SMC)}, the mean {_mean(keeping, SMC)}, and the greatest "
        f"acceleration {_accel(keeping, SMC)}; the figure's axis for it ends at 20 mm/s²."
    )


def _smc_failure(flown: Flown) -> str:
    greatest = number(flown["failure"].max_error()[FAILED_SMC, 0])
    return (
        f"On this seed the error grows to {greatest} m, and returns slowly: on the printed sliding surface an error "
        "along x decays with 0.01 / 500 per second only, in half a day."
    )


def _lqr_or_smc(flown: Flown) -> str:
    failure = flown["failure"]
    more = 100 * (failure.delta_v()[FAILED_SMC].mean() / failure.delta_v()[FAILED_LQR].mean() - 1)
    return (
        f"SMC with the printed settings spends {more:.3g} % more than LQR with the printed weights, but its mean error "
        f"is {_mean(failure, FAILED_SMC)} against {_mean(failure, FAILED_LQR)}: the thesis's conclusion is not "
        "reproduced."
    )


def _reconfiguration(flown: Flown) -> str:
    flights = flown["small position error"]
    return (
        f"No weight is printed for this section; a = {figure_flights.MANEUVER_S2:g} gives {_accel(flights, 0)}, "
        f"about the figure's 60 mm/s². After 0.4 periods the error is {number(_after(flights, 0.4))} m."
    )


def _after(flights: Flights, periods: float) -> float:
    """Error at a time, mean over the seeds of the first policy, m."""
    place = int(abs(flights.time_s - periods * flights.scenario.orbit.period_s).argmin())
    return float(flights.position_error_m[place, 0].mean())


def _start(name: str, what: str) -> Callable[[Flown], str]:
    def note(flown: Flown) -> str:
        return f"{what} It costs {_spent(flown[name], 0)}; from the small position error {_spent(flown[NEAR], 0)}."

    return note


def _velocity(values: tuple[float, ...]) -> str:
    words = ", ".join(f"{value:g}" for value in values)
    return f"The thesis does not print the velocities; here it starts with [{words}] m/s."


def _mission(flown: Flown) -> str:
    flights = flown["mission"]
    return (
        f"Neither weight nor entry are printed for this section; a = {figure_flights.MANEUVER_S2:g} as in section "
        f"5.2.4 gives {_accel(flights, 0)}. The greatest error, {_max(flights, 0)}, is the distance to the circle when "
        f"the "
        "formations change; at the entry of section 5.2.4, now on the far side, it would be 5 km."
    )


NEAR: Final = "small position error"
NOTES: Final[dict[str, Callable[[Flown], str]]] = {
    "3.4": _in_track,
    "5.2": _initialization("0.5", "the figure's axes end at 30 m and 20 mm/s²"),
    "5.3": _initialization("0.1", "the figure's axes end at 150 m and 80 mm/s²"),
    "5.5": _transfer_times,
    "5.6": _estimation,
    "5.7": _keeping,
    "5.9": _tighter,
    "5.10": _sweep,
    "5.11": lambda flown: MEASUREMENTS,
    "5.12": _failure,
    "5.13": _with_and_without,
    "5.14": _smc,
    "5.17": lambda flown: MEASUREMENTS,
    "5.18": _smc_failure,
    "5.19": _lqr_or_smc,
    "5.20": _reconfiguration,
    "5.22": _start("large position error", "Entry at the opposite point of the circle, [0, −3324, 0, −1.8, 0, −3.6]."),
    "5.23": _start("small velocity error", _velocity(figure_flights.SMALL_VELOCITY_M_S)),
    "5.24": _start("large velocity error", _velocity(figure_flights.LARGE_VELOCITY_M_S)),
    "5.25": _mission,
}
"""Notes by the figure's number; not every figure needs one."""
