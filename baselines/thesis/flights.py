"""Many flights at once, with exact sums and maxima between the instants that are kept."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from baselines.design.guidance import GuidanceName, desired_states
from baselines.experiments.policy_batch import SideBySide
from formation_env.envs import interface
from formation_env.envs.vector import FormationVectorEnv
from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import legs

Floats = NDArray[np.float32]

_SEES: Final = {"process_noise_m_s2": 1.0, "sigma_pos_m": 1e-6, "sigma_vel_m_s": 1e6}
"""Beliefs of a filter that takes each measured position for the truth, and nothing else."""

FEW: Final = 1
"""Seeds of each policy whose whole states are kept, unless another number is asked for."""


@dataclass(frozen=True)
class Flights:
    """Flights of some policies on the same seeds, at the instants that were kept.

    An interval is what lies after the kept instant before, up to and including a kept instant; the first one is empty.
    From the step on that ended an episode early, everything is NaN.

    Attributes:
        scenario: what was flown.
        seeds: one per episode.
        steps: kept instants (instants,), in steps from the start.
        desired: states (instants, 6) of the desired path, m and m/s.
        position_error_m: distance from the desired path (instants, policies, seeds).
        accel_m_s2: magnitude of the acceleration over the step to each instant (instants, policies, seeds).
        error_sum_m: sum of the distances over the steps of each interval (instants, policies, seeds).
        error_max_m: greatest distance of each interval (instants, policies, seeds).
        accel_max_m_s2: greatest acceleration of each interval (instants, policies, seeds).
        delta_v_m_s: delta-v of each interval (instants, policies, seeds).
        effort_m_s: the same of each axis by itself (instants, policies, seeds, 3).
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
        """Time of the kept instants (instants,), s."""
        return self.steps * self.scenario.dt_s

    def error_m(self, policy: int, seed: int = 0) -> Array:
        """Error vectors (instants, 3) of one of the first few seeds: desired minus true position, m, as in Ma 2009."""
        error: Array = self.desired[:, :3] - self.truth[:, policy, seed, :3].astype(float)
        return error

    def index(self, periods: float) -> int:
        """Which kept instant is that many orbital periods after the start.

        Raises:
            ValueError: it was not kept; whole periods, and beginnings, arrivals and ends of phases always are.
        """
        step = self.scenario.steps(periods)
        place = int(np.searchsorted(self.steps, step))
        if place == len(self.steps) or self.steps[place] != step:
            raise ValueError(f"flights: the instant {periods:g} periods after the start was not kept")
        return place

    def window(self, end: float | None = None, start: float = 0.0) -> slice:
        """The intervals between two times in orbital periods; the end of the flight by default."""
        last = len(self.steps) - 1 if end is None else self.index(end)
        return slice(self.index(start) + 1, last + 1)

    def delta_v(self, end: float | None = None, start: float = 0.0) -> Array:
        """Delta-v between two times in orbital periods (policies, seeds), m/s."""
        return np.asarray(self.delta_v_m_s[self.window(end, start)].sum(axis=0))

    def effort(self, end: float | None = None, start: float = 0.0) -> Array:
        """The same of each axis by itself (policies, seeds, 3), m/s."""
        return np.asarray(self.effort_m_s[self.window(end, start)].sum(axis=0))

    def mean_error(self, end: float | None = None, start: float = 0.0) -> Array:
        """Mean distance from the desired path between two times in orbital periods (policies, seeds), m."""
        window = self.window(end, start)
        steps = self.steps[window.stop - 1] - self.steps[window.start - 1]
        return np.asarray(self.error_sum_m[window].sum(axis=0) / steps)

    def max_error(self, end: float | None = None, start: float = 0.0) -> Array:
        """Greatest of the same (policies, seeds), m."""
        return np.asarray(self.error_max_m[self.window(end, start)].max(axis=0), float)

    def max_accel(self, end: float | None = None, start: float = 0.0) -> Array:
        """Greatest acceleration between two times in orbital periods (policies, seeds), m/s^2."""
        return np.asarray(self.accel_max_m_s2[self.window(end, start)].max(axis=0), float)


def fly(
    policies: Sequence[Policy],
    scenario: Scenario,
    seeds: Sequence[int],
    guide: GuidanceName = "automatic",
    every: int = 1,
    few: int = FEW,
    measured: bool = False,
    start: Array | None = None,
    progress: Callable[[int], Any] = lambda steps: None,
) -> Flights:
    """Fly all policies on all seeds, side by side in one batch.

    Args:
        policies: what chooses the actions.
        scenario: what is flown.
        seeds: one per episode, the same for all policies.
        guide: the desired path that errors are measured from, see `baselines.design.guidance`.
        every: steps between kept instants; sums and maxima are exact all the same.
        few: seeds of each policy, the first ones, whose states are kept.
        measured: whether their measurements are kept, too.
        start: true LVLH state (6,) to start at in place of the scenario's start and its spread, m and m/s.
        progress: called with the number of steps flown since the last call, of all rows together.
    """
    env = FormationVectorEnv(len(policies) * len(seeds), scenario)
    options = None if start is None else {interface.START_OPTION: start}
    observations, infos = env.reset(seed=[*seeds] * len(policies), options=options)
    few = min(few, len(seeds))
    log = _Log(scenario, (len(policies), len(seeds)), kept_steps(scenario, every), few, guide)
    witness = _Witness(scenario, len(policies), seeds[:few], options) if measured else None
    log.add(infos, measurement=witness.seen if witness else None)
    crew, going = SideBySide(policies), np.ones(env.num_envs, bool)
    for _ in range(scenario.num_steps):
        actions = crew.predict(observations)[0]
        observations, _, terminations, truncations, infos = env.step(actions)
        if terminations.any() or truncations.any():
            infos = _with_finals(infos)
        if witness:
            witness.step(actions)
        log.add(infos, going, witness.seen if witness else None)
        going &= ~(terminations | truncations)
        progress(env.num_envs)
    return log.flights(tuple(int(seed) for seed in seeds))


def kept_steps(scenario: Scenario, every: int) -> NDArray[np.intp]:
    """Every so many steps, all whole periods, and the beginnings, arrivals and ends of phases."""
    periods = [scenario.steps(time) for time in whole_periods(scenario)]
    marks = [step for leg in legs(scenario) for step in (leg.start, leg.arrival, leg.end)]
    return np.unique(np.array([*range(0, scenario.num_steps, every), *periods, *marks], np.intp))


def whole_periods(scenario: Scenario) -> list[int]:
    """How many orbital periods have passed at each whole one, from 1 on."""
    longest = round(scenario.num_steps * scenario.dt_s / scenario.orbit.period_s)
    return [time for time in range(1, longest + 1) if scenario.steps(time) <= scenario.num_steps]


def desired_path(scenario: Scenario, guide: GuidanceName) -> Array:
    """The desired path (num_steps + 1, 6): each leg's from its beginning, the end of a leg being its own."""
    states = np.empty((scenario.num_steps + 1, 6))
    for leg in legs(scenario):
        first = leg.start + 1 if leg.index else 0
        states[first : leg.end + 1] = desired_states(scenario, leg, guide)[first - leg.start :]
    return states


def _with_finals(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos of a step, with those of the ended episodes in place of the new ones'."""
    finals, ended = infos["final_info"], infos["_final_info"]
    merged = dict(infos)
    for name in ("true_state", "estimate", "measured", interface.INFO_THRUST):
        mask = ended if finals[name].ndim == 1 else ended[:, None]
        merged[name] = np.where(mask, finals[name], infos[name])
    return merged


class _Witness:
    """Sees the measurements: it flies the same episodes with a filter that trusts nothing else, and gives its estimate.

    Attributes:
        seen: the last measured positions (policies, few, 3), m; NaN where none arrived.
    """

    def __init__(
        self, scenario: Scenario, policies: int, seeds: Sequence[int], options: dict[str, Array] | None
    ) -> None:
        self._shape = (policies, len(seeds))
        self._env = FormationVectorEnv(
            policies * len(seeds), replace(scenario, filter=replace(scenario.filter, **_SEES))
        )
        self._look(self._env.reset(seed=[*seeds] * policies, options=options)[1])

    def step(self, actions: Floats) -> None:
        """The same step as that of all rows (rows, 3)."""
        policies, few = self._shape
        chosen = actions.reshape(policies, -1, 3)[:, :few].reshape(-1, 3)
        *_, terminations, truncations, infos = self._env.step(chosen)
        self._look(_with_finals(infos) if (terminations | truncations).any() else infos)

    def _look(self, infos: dict[str, Any]) -> None:
        seen = np.where(infos["measured"][:, None], infos["estimate"][:, :3], np.nan)
        self.seen = seen.reshape(*self._shape, 3)


class _Log:
    """Adds up infos step by step, and keeps what `Flights` has."""

    def __init__(
        self, scenario: Scenario, shape: tuple[int, int], steps: NDArray[np.intp], few: int, guide: GuidanceName
    ) -> None:
        count = len(steps)
        longest = int(np.diff(steps, prepend=-1).max())
        self._scenario, self._steps, self._shape, self._few = scenario, steps, shape, few
        self._path = desired_path(scenario, guide)
        self._step = self._place = self._filled = 0
        self._positions = np.empty((longest, shape[0] * shape[1], 3))
        self._thrusts = np.empty_like(self._positions)
        self._now, self._intervals = np.empty((2, count, *shape), np.float32), np.empty((2, count, *shape), np.float32)
        self._sums, self._effort = np.empty((2, count, *shape)), np.empty((count, *shape, 3))
        self._states = np.empty((2, count, shape[0], few, 6), np.float32)
        self._few_thrusts = np.empty((count, shape[0], few, 3), np.float32)
        self._measurements = np.full((count, shape[0], few, 3), np.nan, np.float32)

    def add(
        self, infos: dict[str, Any], going: NDArray[np.bool_] | None = None, measurement: Array | None = None
    ) -> None:
        """The next instant; rows that are not going any more give NaN."""
        self._positions[self._filled] = infos["true_state"][:, :3] - self._path[self._step, :3]
        self._thrusts[self._filled] = infos[interface.INFO_THRUST]
        if going is not None and not going.all():
            self._positions[self._filled, ~going] = self._thrusts[self._filled, ~going] = np.nan
        self._filled += 1
        if self._step == self._steps[self._place]:
            if measurement is not None:
                self._measurements[self._place] = measurement
            self._keep(infos)
        self._step += 1

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
        for kept, name in zip(self._states, ("true_state", "estimate"), strict=True):
            kept[place] = self._first_few(infos[name])
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
        """All that was kept."""
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
