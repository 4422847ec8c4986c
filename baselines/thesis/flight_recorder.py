"""Recorder of batched flights: sums every step, keeps some instants."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from baselines.design.guidance import GuidanceName, desired_states
from baselines.thesis.recorded_flights import Flights
from formation_env.envs import info_keys
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import legs

MEASUREMENT: Final = "measurement"
"""Info of an environment made with `analysis=True`."""


def recorded_steps(scenario: Scenario, every: int) -> NDArray[np.intp]:
    """Kept instants: every n-th step, whole periods, and starts, arrivals and ends of phases."""
    periods = [scenario.steps(time) for time in whole_periods(scenario)]
    marks = [step for leg in legs(scenario) for step in (leg.start, leg.arrival, leg.end)]
    return np.unique(np.array([*range(0, scenario.num_steps, every), *periods, *marks], np.intp))


def whole_periods(scenario: Scenario) -> list[int]:
    """Whole numbers of orbital periods within a scenario, from 1 on."""
    longest = round(scenario.num_steps * scenario.dt_s / scenario.orbit.period_s)
    return [time for time in range(1, longest + 1) if scenario.steps(time) <= scenario.num_steps]


def desired_path(scenario: Scenario, guide: GuidanceName) -> Array:
    """Desired path (num_steps + 1, 6); the last instant of a leg belongs to that leg."""
    states = np.empty((scenario.num_steps + 1, 6))
    for leg in legs(scenario):
        first = leg.start + 1 if leg.index else 0
        states[first : leg.end + 1] = desired_states(scenario, leg, guide)[first - leg.start :]
    return states


class FlightRecorder:
    """Accumulates infos step by step into `Flights`."""

    def __init__(
        self, scenario: Scenario, shape: tuple[int, int], steps: NDArray[np.intp], few: int, guide: GuidanceName
    ) -> None:
        count, few = len(steps), min(few, shape[1])
        longest = int(np.diff(steps, prepend=-1).max())
        self._scenario, self._steps, self._shape, self._few = scenario, steps, shape, few
        self._path = desired_path(scenario, guide)
        self._step = self._place = self._filled = 0
        self._going = np.ones(shape[0] * shape[1], bool)
        self._positions = np.empty((longest, shape[0] * shape[1], 3))
        self._thrusts = np.empty_like(self._positions)
        self._now, self._intervals = np.empty((2, count, *shape), np.float32), np.empty((2, count, *shape), np.float32)
        self._sums, self._effort = np.empty((2, count, *shape)), np.empty((count, *shape, 3))
        self._states = np.empty((2, count, shape[0], few, 6), np.float32)
        self._few_thrusts = np.empty((count, shape[0], few, 3), np.float32)
        self._measurements = np.full((count, shape[0], few, 3), np.nan, np.float32)

    def add(self, infos: dict[str, Any], ended: NDArray[np.bool_] | None = None) -> None:
        """Add the next instant, with the rows that ended at it; rows whose episode ended before give NaN."""
        self._positions[self._filled] = infos["true_state"][:, :3] - self._path[self._step, :3]
        self._thrusts[self._filled] = infos[info_keys.THRUST]
        self._positions[self._filled, ~self._going] = self._thrusts[self._filled, ~self._going] = np.nan
        self._filled += 1
        if self._step == self._steps[self._place]:
            if MEASUREMENT in infos:
                received = np.where(infos["measured"][:, None], infos[MEASUREMENT][:, :3], np.nan)
                self._measurements[self._place] = self._first_few(received)
            self._keep(infos)
        self._step += 1
        if ended is not None:
            self._going &= ~ended

    def _keep(self, infos: dict[str, Any]) -> None:
        """Close an interval; the one of the start is empty."""
        place, dt_s = self._place, self._scenario.dt_s
        error = self._distances(self._positions)
        accel = self._distances(self._thrusts)
        if place == 0:
            self._intervals[:, 0] = self._sums[:, 0] = self._effort[0] = 0.0
        else:
            self._intervals[:, place] = error.max(axis=0), accel.max(axis=0)
            self._sums[:, place] = error.sum(axis=0), dt_s * accel.sum(axis=0)
            axes = np.abs(self._thrusts[: self._filled]).sum(axis=0)
            self._effort[place] = dt_s * axes.reshape(*self._shape, 3)
        self._now[:, place] = error[-1], accel[-1]
        for states, name in zip(self._states, ("true_state", "estimate"), strict=True):
            states[place] = self._first_few(infos[name])
        self._few_thrusts[place] = self._first_few(self._thrusts[self._filled - 1])
        self._states[:, place][np.isnan(self._now[0, place][:, : self._few])[None].repeat(2, 0)] = np.nan
        self._place, self._filled = place + 1, 0

    def _distances(self, buffer: Array) -> Array:
        """Lengths (steps, policies, seeds) of the interval's vectors."""
        vectors = buffer[: self._filled]
        lengths: Array = np.sqrt(np.einsum("sra,sra->sr", vectors, vectors))
        return lengths.reshape(-1, *self._shape)

    def _first_few(self, values: Array) -> Array:
        """Values (policies, few, ...) of the first few seeds from (rows, ...)."""
        return values.reshape(*self._shape, -1)[:, : self._few]

    def flights(self, seeds: tuple[int, ...]) -> Flights:
        """The recorded flights."""
        return Flights(
            scenario=self._scenario,
            seeds=seeds,
            steps=self._steps,
            desired=self._path[self._steps],
            position_error_m=self._now[0],
            accel_m_s2=self._now[1],
            error_sum_m=self._sums[0],
            error_max_m=self._intervals[0],
            accel_max_m_s2=self._intervals[1],
            delta_v_m_s=self._sums[1],
            effort_m_s=self._effort,
            truth=self._states[0],
            estimate=self._states[1],
            thrust_m_s2=self._few_thrusts,
            measurement=self._measurements,
        )
