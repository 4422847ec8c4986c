"""Scenarios: all settings of an environment."""

from dataclasses import fields, replace
from functools import lru_cache
from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from formation_env.dropout import AnyDropout, GilbertElliott
from formation_env.dynamics import NONLINEAR, DiscreteModel, get_dynamics
from formation_env.dynamics.coasting import check_leader_path
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.world import World
from formation_env.navigation.filter_settings import FilterModel, KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Acceleration, PositiveDistance
from formation_env.settings import ConfigError, Positive, Text, faults_of, settings
from formation_env.task.checks import (
    check_alike,
    check_durations,
    check_followers,
    check_memory,
    check_models,
    check_safety,
    check_slots,
    check_spacecraft,
    check_start,
)
from formation_env.task.followers import (
    Followers,
    FollowerSettings,
    InterSatelliteLink,
    Neighbours,
    Safety,
)
from formation_env.task.phases import Limits, Phase, Start, whole_steps
from formation_env.task.randomization import DomainRandomization
from formation_env.task.reward import Reward


@settings
class Scenario:
    """All settings of an environment; frozen, and checked on construction.

    Attributes:
        title: one line for readers.
        orbit: the leader's orbit.
        spacecraft: the follower.
        leader_spacecraft: the leader; equal to the follower if left out.
        dynamics: name of the true dynamics: a linear model, or `nonlinear`.
        perturbations: forces of the nonlinear truth beside gravity.
        process_noise_m_s2: 1-sigma of a random acceleration of each axis, held over a step, m/s^2.
        sensor: relative navigation.
        filter: the Kalman filter's model where it differs from the truth.
        dropout: when measurements are lost.
        dt_s: time step, s.
        start: where episodes start.
        phases: the phases of the mission, in order.
        reward: weights and error cost.
        limits: conditions that end an episode early.
        safety: distances that cost or end an episode.
        tolerance_m: position error that counts as good in the report, m.
        followers: number of followers; formations must have a slot for each.
        slots: whether follower i flies in slot i of each phase (`fixed`), or each episode draws who flies where
            (`random`); it starts in slot i either way.
        follower_settings: what each follower has of its own, in order; empty if they are alike.
        inter_satellite_link: links between followers.
        neighbours: how many others a follower's observation shows; None: all.
        observation_length_m: scale of lengths in the observation; None: the largest distance of the plan, and more if
            it needs that, see `task.observation`.
        domain_randomization: quantities that differ from episode to episode; policies are designed for the nominal
            values above.
    """

    title: Text = ""
    orbit: Orbit = Orbit()
    spacecraft: Spacecraft = Spacecraft()
    leader_spacecraft: Spacecraft | None = None
    dynamics: Text = "modified_hcw"
    perturbations: Perturbations = Perturbations()
    process_noise_m_s2: Acceleration = 5e-6
    sensor: Sensor = Sensor()
    filter: KalmanFilter = KalmanFilter()
    dropout: AnyDropout = GilbertElliott()
    dt_s: Positive = 30.0
    start: Start = Start()
    phases: tuple[Phase, ...]
    reward: Reward = Reward()
    limits: Limits = Limits()
    safety: Safety = Safety()
    tolerance_m: PositiveDistance = 50.0
    followers: Followers = 1
    slots: Literal["fixed", "random"] = "fixed"
    follower_settings: tuple[FollowerSettings, ...] = ()
    inter_satellite_link: InterSatelliteLink = InterSatelliteLink()
    neighbours: Neighbours | None = None
    observation_length_m: PositiveDistance | None = None
    domain_randomization: DomainRandomization | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse what no single field can."""
        check_models(self.dynamics, self.filter.dynamics, self.orbit, self.perturbations)
        check_spacecraft(self.spacecraft, self.leader)
        check_safety(self.safety)
        check_durations(self.phases, self.orbit, self.dt_s)
        check_memory("dt_s", self.num_steps, self.dt_s, self.dynamics, self.filter_model.dynamics)
        if self.followers > 1:
            self._check_followers()
        else:
            check_start(self.start, self.phases, self.limits, self.orbit, self.dt_s)
        if self.dynamics == NONLINEAR:
            check_leader_path(self.world, self.leader, self.num_steps * self.dt_s)
        self.dropout.chain(self.dt_s, self.orbit)
        return self

    def _check_followers(self) -> None:
        """Refuse slots and followers that cannot be."""
        check_followers(self.followers, self.follower_settings, self.neighbours, self.domain_randomization is not None)
        steps = self.num_steps * self.followers**2
        check_memory("followers", steps, self.dt_s, self.dynamics, self.filter_model.dynamics)
        check_slots(self.start, self.phases, self.followers, self.safety, self.orbit, self.dt_s)
        for follower in range(self.followers):
            try:
                alone = self.follower_alone(follower, follower)
            except ConfigError as error:
                raise ValueError(f"follower {follower}: {faults_of(error)}") from None
            check_alike(f"follower_settings.{follower}", alone.sensor.measures, self.sensor.measures)
            check_alike(f"follower_settings.{follower}", alone.filter_model.dynamics, self.filter_model.dynamics)
        self.inter_satellite_link.dropout.chain(self.dt_s, self.orbit)

    def follower_alone(self, follower: int, slot: int) -> Self:
        """The scenario that one of several followers flies, as if it were alone.

        Args:
            follower: its index, which is also the slot that it starts in.
            slot: the slot that it has in all phases.

        Raises:
            ConfigError: the scenario is invalid for this follower.
        """
        own = self.follower_settings[follower] if self.follower_settings else FollowerSettings()
        changed: dict[str, Any] = {field.name: getattr(own, field.name) for field in fields(own)}
        changed = {name: value for name, value in changed.items() if value is not None}
        if "spacecraft" in changed:
            changed["leader_spacecraft"] = self.leader
        start = replace(self.start, formation=self.start.formation.slots(self.followers, self.orbit)[follower])
        formations = [phase.formation.slots(self.followers, self.orbit)[slot] for phase in self.phases]
        changed["phases"] = tuple(map(lambda phase, own: replace(phase, formation=own), self.phases, formations))
        return replace(self, **changed, start=start, followers=1, slots="fixed", follower_settings=(), neighbours=None)

    @property
    def num_neighbours(self) -> int:
        """How many others a follower's observation shows."""
        return self.followers - 1 if self.neighbours is None else self.neighbours

    def steps(self, periods: float) -> int:
        """Nearest whole number of steps of a time in orbital periods."""
        return whole_steps(periods, self.orbit, self.dt_s)

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
        """Orbit and forces of the nonlinear truth."""
        return World(self.orbit, self.perturbations)

    def true_dynamics(self) -> DiscreteModel:
        """The true linear dynamics over one step (6, 6), or over each of the steps (num_steps, 6, 6) if they vary.

        Raises:
            ValueError: the truth is nonlinear.
        """
        return self._model(self.dynamics, self.orbit, self.spacecraft, self.leader)

    @property
    def filter_model(self) -> FilterModel:
        """The filter's model in full."""
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
        """Name of the linear model closest to the truth."""
        if self.dynamics != NONLINEAR:
            return self.dynamics
        return "yamanaka_ankersen" if self.orbit.eccentricity > 0 else "modified_hcw"

    def filter_dynamics(self) -> DiscreteModel:
        """The filter's dynamics over one step (6, 6), or over each of the steps (num_steps, 6, 6) if they vary."""
        filter_model = self.filter_model
        leader = self.leader_spacecraft or filter_model.spacecraft
        return self._model(filter_model.dynamics, filter_model.orbit, filter_model.spacecraft, leader)

    def _model(self, name: str, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft) -> DiscreteModel:
        steps = 0 if get_dynamics(name).time_invariant else self.num_steps
        return _discrete_model(name, self.dt_s, steps, orbit, spacecraft, leader)


@lru_cache(maxsize=64)
def _discrete_model(
    name: str, dt_s: float, steps: int, orbit: Orbit, spacecraft: Spacecraft, leader: Spacecraft
) -> DiscreteModel:
    """Discretise a linear model over one step, or over each of steps > 0; the arrays are shared, so read-only."""
    starts_s = dt_s * np.arange(steps) if steps else 0.0
    model = get_dynamics(name).discretise(starts_s, dt_s, orbit, spacecraft, leader)
    for part in (model.Phi, model.Gamma, model.delta):
        part.setflags(write=False)
    return model
