"""Flights of several laws on the same seeds, with exact sums and maxima between the recorded instants."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Flights:
    """Flights of some policies on the same seeds, at the recorded instants.

    An interval reaches from the previous recorded instant (excluded) to a recorded one (included); the first is empty.
    After an early end everything is NaN.

    Attributes:
        scenario: scenario flown.
        seeds: one per episode.
        steps: recorded instants (instants,), in steps from the start.
        desired: states (instants, 6) of the desired path, m and m/s.
        position_error_m: distance from the desired path (instants, policies, seeds).
        accel_m_s2: magnitude of the acceleration over the step to each instant (instants, policies, seeds).
        error_sum_m: sum of the distances over the steps of each interval (instants, policies, seeds).
        error_max_m: maximum distance of each interval (instants, policies, seeds).
        accel_max_m_s2: maximum acceleration of each interval (instants, policies, seeds).
        delta_v_m_s: delta-v of each interval (instants, policies, seeds).
        effort_m_s: control effort of each axis, the integral of |u_i|, per interval (instants, policies, seeds, 3).
        truth: true states (instants, policies, first few seeds, 6), m and m/s.
        estimate: estimated states, the same shape.
        thrust_m_s2: accelerations over the steps to the instants (instants, policies, first few seeds, 3).
        measurement: measured positions (instants, policies, first few seeds, 3), m; NaN where none arrived, and all
            NaN if they were not asked for.
    """

    scenario: Scenario
    seeds: tuple[int, ...]
    steps: NDArray[np.intp]
    desired: Array
    position_error_m: Floats
    accel_m_s2: Floats
    error_sum_m: Array
    error_max_m: Floats
    accel_max_m_s2: Floats
    delta_v_m_s: Array
    effort_m_s: Array
    truth: Floats
    estimate: Floats
    thrust_m_s2: Floats
    measurement: Floats

    @property
    def time_s(self) -> Array:
        """Time of the recorded instants (instants,), s."""
        return np.asarray(self.steps * self.scenario.dt_s, float)

    def error_m(self, policy: int, seed: int = 0) -> Array:
        """Error vectors (instants, 3) of one of the first few seeds: desired minus true position, m, as in Ma 2009."""
        error: Array = self.desired[:, :3] - self.truth[:, policy, seed, :3].astype(float)
        return error

    def index(self, periods: float) -> int:
        """Index of the recorded instant a number of orbital periods after the start.

        Raises:
            ValueError: it was not recorded; whole periods, and beginnings, arrivals and ends of phases always are.
        """
        step = self.scenario.steps(periods)
        place = int(np.searchsorted(self.steps, step))
        if place == len(self.steps) or self.steps[place] != step:
            raise ValueError(f"flights: the instant {periods:g} periods after the start was not recorded")
        return place

    def span(self, end: float | None = None, start: float = 0.0) -> slice:
        """Intervals between two times in orbital periods; the end of the flight by default."""
        last = len(self.steps) - 1 if end is None else self.index(end)
        return slice(self.index(start) + 1, last + 1)

    def delta_v(self, end: float | None = None, start: float = 0.0) -> Array:
        """Delta-v between two times in orbital periods (policies, seeds), m/s."""
        return np.asarray(self.delta_v_m_s[self.span(end, start)].sum(axis=0))

    def effort(self, end: float | None = None, start: float = 0.0) -> Array:
        """Control effort of each axis between two times in orbital periods (policies, seeds, 3), m/s."""
        return np.asarray(self.effort_m_s[self.span(end, start)].sum(axis=0))

    def mean_error(self, end: float | None = None, start: float = 0.0) -> Array:
        """Mean distance from the desired path between two times in orbital periods (policies, seeds), m."""
        span = self.span(end, start)
        steps = self.steps[span.stop - 1] - self.steps[span.start - 1]
        return np.asarray(self.error_sum_m[span].sum(axis=0) / steps)

    def max_error(self, end: float | None = None, start: float = 0.0) -> Array:
        """Maximum distance from the desired path between two times in orbital periods (policies, seeds), m."""
        return np.asarray(self.error_max_m[self.span(end, start)].max(axis=0), float)

    def max_accel(self, end: float | None = None, start: float = 0.0) -> Array:
        """Maximum acceleration between two times in orbital periods (policies, seeds), m/s^2."""
        return np.asarray(self.accel_max_m_s2[self.span(end, start)].max(axis=0), float)
