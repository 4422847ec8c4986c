"""Avoidance as a layer over any policy: what a follower adds so that nobody comes too near.

Each follower takes half of what a pair must do, and all of what keeps it off the leader. All layers act on estimates,
and widen the least distance by a multiple of their 1-sigma error.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from baselines.swarm.least_change import least_change
from baselines.swarm.planned_neighbours import by_plan
from baselines.swarm.policy import SwarmPolicy
from formation_env.dynamics.hcw import HCW, transition_matrix
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, Positive, settings

SIDE = np.array([0.0, 0.0, 1.0])
"""Where a pair that would meet exactly gives way: cross-track, which its other motion does not feel."""
TOUCHING_M = 1e-3


@settings
class AvoidanceSettings:
    """Settings of the layers.

    Attributes:
        margin_m: added to `safety.min_distance_m`.
        sigmas: so many 1-sigma errors of the relative position are added, too.
        unheard_m_s: and so much for each second since the other's last message: it may give way to somebody else.
        samples: predictive: instants of the coming half orbit at which the distance is predicted.
        urgency_s: predictive: an encounter sooner than this is corrected at once, a later one little by little.
        reach: potential: distance, in units of that to be kept, at which the repulsion begins.
        stiffness_per_s2: potential: repulsive acceleration per metre of the distance that is missing.
        rate_per_s: cbf: rate at which the distance to spare may shrink, twice (both poles of the barrier).
        sweeps: cbf: sweeps of the dual ascent.
    """

    margin_m: NonNegative = 22.0
    sigmas: NonNegative = 2.5
    unheard_m_s: NonNegative = 0.046
    samples: int = 32
    urgency_s: Positive = 150.0
    reach: Positive = 1.5
    stiffness_per_s2: Positive = 2e-5
    rate_per_s: Positive = 8.7e-3
    sweeps: int = 30


class Avoidance(SwarmPolicy, ABC):
    """A policy that corrects another's accelerations.

    Attributes:
        inner: the other.
    """

    def __init__(self, inner: SwarmPolicy, settings: AvoidanceSettings) -> None:
        super().__init__(inner.scenario)
        self.inner, self.settings = inner, settings
        self._least_m = self.scenario.safety.min_distance_m
        self._from_leader_m = max(self._least_m, self.scenario.limits.keep_out_m)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        wanted = np.clip(self.inner.acceleration(observation), -self.limits_m_s2, self.limits_m_s2)
        states, distances_m, shares = self._others(observation)
        return self.correct(observation, wanted, states, distances_m, shares)

    @abstractmethod
    def correct(
        self, observation: Observations, wanted: Array, states: Array, distances_m: Array, shares: Array
    ) -> Array:
        """Accelerations (groups, followers, 3), m/s^2.

        Args:
            observation: (groups, followers, size).
            wanted: by the inner policy (groups, followers, 3), m/s^2.
            states: of the others and the leader, relative to the follower (groups, followers, others, 6).
            distances_m: to be kept from each (groups, followers, others); 0 for none.
            shares: of what keeps it, the follower's own (groups, followers, others).
        """

    def _others(self, observation: Observations) -> tuple[Array, Array, Array]:
        """Relative states, distances to be kept and shares, see `correct`; the leader is the last."""
        neighbours = by_plan(observation, self.layout)
        leader = -self.layout.estimate(observation)[..., None, :]
        present = self.layout.neighbours(observation, "present")
        extra_m = (
            self.settings.margin_m
            + self.settings.sigmas * self.layout.neighbours(observation, "relative_sigma_pos")
            + self.settings.unheard_m_s * self.layout.neighbours(observation, "message_age")
        )
        kept_m = present * (self._least_m + extra_m) * (self._least_m > 0)
        from_leader_m = np.full(
            kept_m[..., :1].shape, (self._from_leader_m + self.settings.margin_m) if self._from_leader_m else 0.0
        )
        shares = np.concatenate([np.full(kept_m.shape, 0.5), np.ones(from_leader_m.shape)], axis=-1)
        return (
            np.concatenate([neighbours, leader], axis=-2),
            np.concatenate([kept_m, from_leader_m], axis=-1),
            shares,
        )


class Potential(Avoidance):
    """Repulsion: an acceleration away from whoever is near, in proportion to the distance that is missing."""

    name: ClassVar[str] = "potential"

    def correct(
        self, observation: Observations, wanted: Array, states: Array, distances_m: Array, shares: Array
    ) -> Array:
        """See `Avoidance.correct`."""
        distance_m, direction = _polar(states[..., :3])
        missing_m = np.maximum(self.settings.reach * distances_m - distance_m, 0.0)
        push = 2 * shares * self.settings.stiffness_per_s2 * missing_m
        pushed: Array = wanted - (push[..., None] * direction).sum(axis=-2)
        return pushed


class Barrier(Avoidance):
    """A control-barrier quadratic program for HCW's relative degree two (Ames et al. 2019, section IV).

    With h = |r|^2 - d^2, every pair keeps h'' + 2 k h' + k^2 h >= 0. The follower takes the least change of what it
    wants that keeps its share, within the thrust limits.
    """

    name: ClassVar[str] = "cbf"

    def __init__(self, inner: SwarmPolicy, settings: AvoidanceSettings) -> None:
        super().__init__(inner, settings)
        self._drift = HCW().state_matrix(self.scenario.orbit, self.scenario.spacecraft)[3:]

    def correct(
        self, observation: Observations, wanted: Array, states: Array, distances_m: Array, shares: Array
    ) -> Array:
        """See `Avoidance.correct`."""
        normals, least = self.constraints(states, distances_m, shares)
        return least_change(wanted, normals, least, self.limits_m_s2, self.settings.sweeps)

    def constraints(self, states: Array, distances_m: Array, shares: Array) -> tuple[Array, Array]:
        """Half-spaces of accelerations that keep the follower's share: normals . a >= least, see `least_change`."""
        k = self.settings.rate_per_s
        r, v = states[..., :3], states[..., 3:]
        h = np.vecdot(r, r) - distances_m**2
        drift = np.vecdot(v, v) + np.vecdot(r, states @ self._drift.T) + 2 * k * np.vecdot(r, v) + k**2 * h / 2
        # drift + r . (a_other - a_own) >= 0, of which -r . a_own >= -share * drift is the follower's own part
        length = np.maximum(np.linalg.norm(r, axis=-1), TOUCHING_M)
        least = np.where(distances_m > 0, -shares * drift / length, -np.inf)
        return -r / length[..., None], least


class Predictive(Avoidance):
    """The least impulse that moves all predicted closest approaches far enough.

    Both coast by the HCW equations, until the arrival in a transfer, else for half an orbit. An impulse u moves the
    relative position at the time t of the closest approach by -Phi_rv(t) u, of which the part along the line between
    the two, e, counts: -(Phi_rv' e) . u >= what is missing there, and for those that pass far enough what is to spare.
    The barrier is below that, for what the coasts do not foresee: the others' thrust, and the follower's own.
    """

    name: ClassVar[str] = "predictive"

    def __init__(self, inner: SwarmPolicy, settings: AvoidanceSettings) -> None:
        super().__init__(inner, settings)
        orbit = self.scenario.orbit
        self._times_s = np.linspace(0, orbit.period_s / 2, settings.samples + 1)
        self._Phi = transition_matrix(orbit.mean_motion_rad_s, self._times_s)[:, :3]
        self._barrier = Barrier(inner, settings)

    def correct(
        self, observation: Observations, wanted: Array, states: Array, distances_m: Array, shares: Array
    ) -> Array:
        """See `Avoidance.correct`."""
        dt_s = self.scenario.dt_s
        after = states.copy()
        after[..., 3:] -= dt_s * wanted[..., None, :]
        paths = np.einsum("tij,...j->...ti", self._Phi, after)
        squares = np.vecdot(paths, paths)
        arrival_s = self.layout.time_to_arrival_s(observation)[..., None, None]
        beyond = (self._times_s > arrival_s) & (arrival_s > 0)
        at = np.where(beyond, np.inf, squares).argmin(axis=-1)
        nearest = np.take_along_axis(paths, at[..., None, None], axis=-2)[..., 0, :]
        distance_m, direction = _polar(nearest)
        leverage = np.einsum("...ij,...i->...j", self._Phi[at][..., 3:], direction)
        size_s = np.maximum(np.linalg.norm(leverage, axis=-1), dt_s)
        soon = np.minimum(1.0, self.settings.urgency_s / np.maximum(self._times_s[at], dt_s))
        missing_m = distances_m - distance_m
        missing_m = np.where(missing_m > 0, soon, 1.0) * shares * missing_m
        normals = -leverage / size_s[..., None]
        least = np.vecdot(normals, wanted[..., None, :]) + missing_m / (size_s * dt_s)
        least = np.where(distances_m > 0, least, -np.inf)
        near_normals, near_least = self._barrier.constraints(states, distances_m, shares)
        return least_change(
            wanted,
            np.concatenate([normals, near_normals], axis=-2),
            np.concatenate([least, near_least], axis=-1),
            self.limits_m_s2,
            self.settings.sweeps,
        )


def _polar(vectors: Array) -> tuple[Array, Array]:
    """Lengths (...) and directions (..., 3) of vectors (..., 3); those of no length point to `SIDE`."""
    length = np.linalg.norm(vectors, axis=-1)
    known = length[..., None] > TOUCHING_M
    return length, np.where(known, vectors / np.where(known, length[..., None], 1.0), SIDE)


AVOIDANCE = {layer.name: layer for layer in (Potential, Barrier, Predictive)}
"""All layers, by name."""
