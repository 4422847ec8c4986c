"""What is flown: a scenario, and its loader."""

import math
from dataclasses import fields, replace
from functools import lru_cache
from typing import Self

import numpy as np
from pydantic import model_validator

from formation_env.dropout import AnyDropout, GilbertElliott
from formation_env.dynamics import DYNAMICS, NONLINEAR, DiscreteModel, get_dynamics
from formation_env.dynamics.nonlinear import World
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.formations import AnyFormation, AtLeader
from formation_env.navigation.filter_settings import FilterModel, KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.orbital.orbit import Orbit
from formation_env.settings import NonNegative, Positive, Text, nearest, settings
from formation_env.task.randomization import DomainRandomization
from formation_env.task.reward import Reward


@settings(renamed={"spread_pos_m": "initial_sigma_pos_m", "spread_vel_m_s": "initial_sigma_vel_m_s"})
class Start:
    """Where an episode starts.

    Attributes:
        formation: the nominal start is this formation's state.
        initial_sigma_pos_m: 1-sigma of the true position about it, each axis, m.
        initial_sigma_vel_m_s: 1-sigma of the true velocity about it, each axis, m/s.
    """

    formation: AnyFormation = AtLeader()
    initial_sigma_pos_m: NonNegative = 10.0
    initial_sigma_vel_m_s: NonNegative = 0.01


@settings(renamed={"transfer_periods": "transfer_orbits", "hold_periods": "hold_orbits"})
class Phase:
    """One leg of the mission: get to a formation, then hold it.

    Both times are rounded to whole steps.

    Attributes:
        formation: the target; the follower should be at its state at the arrival.
        transfer_orbits: time to get there, in orbital periods; 0 is to be there at once.
        hold_orbits: time to stay, in orbital periods.
    """

    formation: AnyFormation
    transfer_orbits: NonNegative = 0.0
    hold_orbits: Positive


@settings
class Limits:
    """What ends an episode early.

    Attributes:
        max_distance_m: greatest distance from the reference, m.
        keep_out_m: radius of a sphere around the leader that must not be entered, m; 0 is none.
    """

    max_distance_m: Positive = 50e3
    keep_out_m: NonNegative = 0.0


@settings
class Scenario:
    """All settings of an environment; frozen, and checked when made.

    Attributes:
        title: one line for people.
        orbit: the leader's orbit.
        spacecraft: the follower.
        leader_spacecraft: the leader; like the follower if left out.
        dynamics: name of the true dynamics: a linear model, or `nonlinear`.
        perturbations: what acts in the nonlinear truth beside gravity.
        process_noise_m_s2: 1-sigma of a random acceleration of each axis, held over a step, m/s^2.
        sensor: relative navigation.
        filter: what the Kalman filter believes.
        dropout: when measurements are lost.
        dt_s: time step, s.
        start: where episodes start.
        phases: the legs of the mission, in order.
        reward: weights.
        limits: early ends.
        tolerance_m: position error that counts as good in the report, m.
        domain_randomization: what differs from episode to episode; what is said above is the middle that policies
            are made for.
    """

    title: Text = ""
    orbit: Orbit = Orbit()
    spacecraft: Spacecraft = Spacecraft()
    leader_spacecraft: Spacecraft | None = None
    dynamics: Text = "modified_hcw"
    perturbations: Perturbations = Perturbations()
    process_noise_m_s2: NonNegative = 5e-6
    sensor: Sensor = Sensor()
    filter: KalmanFilter = KalmanFilter()
    dropout: AnyDropout = GilbertElliott()
    dt_s: Positive = 30.0
    start: Start = Start()
    phases: tuple[Phase, ...]
    reward: Reward = Reward()
    limits: Limits = Limits()
    tolerance_m: Positive = 50.0
    domain_randomization: DomainRandomization | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse what no single field can: unknown models, times that do not fit the step, an impossible start."""
        for key, name, known in (
            ("dynamics", self.dynamics, [*DYNAMICS, NONLINEAR]),
            ("filter.dynamics", self.filter.dynamics, [*DYNAMICS]),
        ):
            if name is not None and name not in known:
                raise ValueError(f"{key}: no dynamics model named {name!r}; {nearest(name, known)}")
        self._check_truth()
        least, greatest = self.spacecraft.min_accel_m_s2, math.sqrt(3) * self.spacecraft.max_accel_m_s2
        if least > greatest:
            raise ValueError(
                f"spacecraft.min_accel_m_s2: must not be above the greatest thrust, {greatest:.4g}, got {least:g}"
            )
        density, leaders = self.spacecraft.air_density_kg_m3, self.leader.air_density_kg_m3
        if leaders != density:
            raise ValueError(
                f"leader_spacecraft.air_density_kg_m3: must be the follower's, {density:g}, got {leaders:g}"
            )
        self._check_clock()
        self._check_start()
        self.dropout.chain(self.dt_s, self.orbit)
        return self

    def _check_truth(self) -> None:
        """Refuse a truth that would leave out what other settings ask for."""
        if self.dynamics == NONLINEAR:
            return
        if self.perturbations != Perturbations():
            raise ValueError(f"perturbations: act in the truth nonlinear only, but dynamics is {self.dynamics!r}")
        if self.orbit.eccentricity > 0 and get_dynamics(self.dynamics).time_invariant:
            raise ValueError(
                f"dynamics: {self.dynamics} is for circular orbits, got orbit.eccentricity = "
                f"{self.orbit.eccentricity:g}; use yamanaka_ankersen or nonlinear"
            )

    def _check_clock(self) -> None:
        """Refuse too many steps, and phases shorter than a step."""
        if not self.phases:
            raise ValueError("phases: must have at least one phase, got []")
        periods = sum(phase.transfer_orbits + phase.hold_orbits for phase in self.phases)
        steps = periods * self.orbit.period_s / self.dt_s
        if steps > MAX_EPISODE_STEPS:
            raise ValueError(f"dt_s: {steps:.7g} steps of {self.dt_s:g} s; an episode has at most {MAX_EPISODE_STEPS}")
        for index, phase in enumerate(self.phases):
            for key in ("transfer_orbits", "hold_orbits"):
                periods = getattr(phase, key)
                if periods > 0 and self.steps(periods) == 0:
                    seconds = periods * self.orbit.period_s
                    raise ValueError(
                        f"phases.{index}.{key}: {periods:g} periods are {seconds:.4g} s, which rounds to no step of "
                        f"dt_s = {self.dt_s:g} s"
                    )

    def _check_start(self) -> None:
        """Refuse a nominal start, or a change of phase, that would end the episode at once."""
        place = self.start.formation.state(self.orbit)[:3]
        range_m = math.hypot(*place)
        if range_m < self.limits.keep_out_m:
            raise ValueError(
                f"start.formation: {range_m:.6g} m from the leader, inside limits.keep_out_m = "
                f"{self.limits.keep_out_m:g} m"
            )
        start_s = 0.0
        for index, phase in enumerate(self.phases):
            arrival_s = start_s + self.steps(phase.transfer_orbits) * self.dt_s
            end_s = arrival_s + self.steps(phase.hold_orbits) * self.dt_s
            distance_m = math.dist(place, phase.formation.reference(start_s, self.orbit, arrival_s)[:3])
            if distance_m > self.limits.max_distance_m:
                key = f"phases.{index}.formation" if index else "start.formation"
                raise ValueError(
                    f"{key}: {distance_m:.6g} m between the {'phase before' if index else 'start'} and the phase's "
                    f"reference, beyond limits.max_distance_m = {self.limits.max_distance_m:g} m"
                )
            place, start_s = phase.formation.reference(end_s, self.orbit, arrival_s)[:3], end_s

    def steps(self, periods: float) -> int:
        """A time in orbital periods as the nearest number of whole steps."""
        return round(periods * self.orbit.period_s / self.dt_s)

    @property
    def num_steps(self) -> int:
        """Steps of a whole episode."""
        return sum(self.steps(p.transfer_orbits) + self.steps(p.hold_orbits) for p in self.phases)

    @property
    def hold_s(self) -> float:
        """Total hold time of an episode, s."""
        return self.dt_s * sum(self.steps(p.hold_orbits) for p in self.phases)

    @property
    def leader(self) -> Spacecraft:
        """The leader's spacecraft."""
        return self.leader_spacecraft or self.spacecraft

    @property
    def world(self) -> World:
        """What the nonlinear truth is made of."""
        return World(self.orbit, self.perturbations)

    def true_dynamics(self) -> DiscreteModel:
        """The true linear dynamics over one step (6, 6), or over each of the steps (num_steps, 6, 6) if they vary.

        Raises:
            ValueError: the truth is nonlinear.
        """
        return self._model(self.dynamics, self.orbit, self.spacecraft, self.leader)

    @property
    def filter_model(self) -> FilterModel:
        """What the filter believes, in full."""
        truth = FilterModel(
            dynamics=self._default_filter_dynamics,
            sigma_pos_m=self.sensor.sigma_pos_m,
            sigma_vel_m_s=self.sensor.sigma_vel_m_s,
            process_noise_m_s2=self.process_noise_m_s2,
            thrust_noise=self.spacecraft.thrust_noise,
            orbit=self.orbit,
            spacecraft=self.spacecraft,
            initial_sigma_pos_m=self.start.initial_sigma_pos_m,
            initial_sigma_vel_m_s=self.start.initial_sigma_vel_m_s,
        )
        own = {field.name: getattr(self.filter, field.name) for field in fields(truth)}
        return replace(truth, **{name: value for name, value in own.items() if value is not None})

    @property
    def _default_filter_dynamics(self) -> str:
        """The linear model nearest to the truth."""
        if self.dynamics != NONLINEAR:
            return self.dynamics
        return "yamanaka_ankersen" if self.orbit.eccentricity > 0 else "modified_hcw"

    def filter_dynamics(self) -> DiscreteModel:
        """The dynamics that the filter believes: over one step (6, 6), or over each (num_steps, 6, 6) if they vary."""
        filter_model = self.filter_model
        leader = self.leader_spacecraft or filter_model.spacecraft
        return self._model(filter_model.dynamics, filter_model.orbit, filter_model.spacecraft, leader)

    def _model(self, name: str, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> DiscreteModel:
        steps = 0 if get_dynamics(name).time_invariant else self.num_steps
        return _discrete_model(name, self.dt_s, steps, orbit, spacecraft, leader)


MAX_EPISODE_STEPS = 1_000_000


@lru_cache(maxsize=64)
def _discrete_model(
    name: str, dt_s: float, steps: int, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft
) -> DiscreteModel:
    """A linear model over one step, or if steps > 0 over each of them; its arrays are shared, so read-only."""
    starts_s = dt_s * np.arange(steps) if steps else 0.0
    model = get_dynamics(name).discretise(starts_s, dt_s, orbit, spacecraft, leader)
    for part in (model.Phi, model.Gamma, model.delta):
        part.setflags(write=False)
    return model
