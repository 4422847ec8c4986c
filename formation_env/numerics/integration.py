"""Integration of ordinary differential equations, bounded in steps."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from formation_env.numerics.arrays import Array

Rates = Callable[[float, Array], Array]
"""Time, s, and state (m,) -> rates (m,)."""

FREE_EVALUATIONS: Final = 20_000
"""Evaluations of the rates that any integration may take: about a second."""
EVALUATIONS_PER_PERIOD: Final = 20_000
"""Evaluations for each further period of the motion; an orbit of e = 0.9 takes 2000 at a tolerance of 1e-12."""


class IntegrationError(RuntimeError):
    """An integration that came to no end.

    Attributes:
        time_s: how far it came, s.
        state: the state there (m,).
    """

    def __init__(self, reason: str, time_s: float, state: Array) -> None:
        super().__init__(f"{reason} at t = {time_s:.6g} s")
        self.time_s, self.state = time_s, state


def integrate(
    rates: Rates,
    start: Array,
    times_s: Array,
    *,
    start_s: float,
    period_s: float,
    rtol: float,
    atol: float | Array,
    height: Rates | None = None,
) -> Array:
    """States (T, m) at times (T,), by Dormand & Prince's method of order 8 (scipy's DOP853).

    Args:
        rates: the right side.
        start: state (m,) at `start_s`.
        times_s: times (T,), s, all on one side of `start_s` and sorted away from it.
        start_s: time of the start, s.
        period_s: period of the motion, which sets how many evaluations a span of time may take, s.
        rtol: relative tolerance of a step.
        atol: absolute tolerance of a step.
        height: a function of time and state; where it falls to 0 the integration ends with an error.

    Raises:
        IntegrationError: rates that are not finite, too many steps, or `height` at 0.
    """
    from scipy.integrate import solve_ivp  # slow to import, and linear truths do without it

    if len(times_s) == 0 or times_s[-1] == start_s:
        return np.broadcast_to(start, (len(times_s), *start.shape)).copy()
    evaluations, reached = 0, (start_s, start)

    def bounded(time_s: float, state: Array) -> Array:
        nonlocal evaluations, reached
        evaluations, reached = evaluations + 1, (time_s, state)
        if evaluations > FREE_EVALUATIONS + EVALUATIONS_PER_PERIOD * abs(time_s - start_s) / period_s:
            raise IntegrationError("too many steps", time_s, state)
        rate = rates(time_s, state)
        if not np.isfinite(rate).all():
            raise IntegrationError("rates that are not finite", time_s, state)
        return rate

    events: Any = None if height is None else _ending(height)
    span = (start_s, float(times_s[-1]))
    with np.errstate(over="ignore", invalid="ignore"):  # `bounded` refuses what comes of it
        solution: Any = solve_ivp(bounded, span, start, "DOP853", times_s, rtol=rtol, atol=atol, events=events)
    if solution.status == 1:
        raise IntegrationError("end of the motion", float(solution.t_events[0][0]), solution.y_events[0][0])
    if not solution.success:
        raise IntegrationError(str(solution.message), *reached)
    states: Array = solution.y.T
    return states


def _ending(height: Rates) -> Rates:
    """An event of scipy's that ends the integration when the height falls through 0."""

    def event(time_s: float, state: Array) -> Array:
        return height(time_s, state)

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event
