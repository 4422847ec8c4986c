"""Base class of the policies for several followers: from all observations of a group to accelerations."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import make_policy
from formation_env.numerics.arrays import Actions, Array, Observations
from formation_env.task.members import members
from formation_env.task.observation import SLICES, ObservationLayout, observation_layout
from formation_env.task.scenario import Scenario


class SwarmPolicy(ABC):
    """A policy without memory for groups of followers, each of which acts on its own observation.

    Attributes:
        scenario: scenario that it is made for.
        layout: of its observations.
        name: name in `SWARM_POLICIES`.
    """

    name: ClassVar[str]

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.layout = scenario, observation_layout(scenario)
        limits = [row[0].spacecraft.max_accel_m_s2 for row in members(scenario)]
        self.limits_m_s2 = np.array(limits)[:, None]

    @abstractmethod
    def acceleration(self, observation: Observations) -> Array:
        """Commanded accelerations (groups, followers, 3), m/s^2, for observations (groups, followers, size)."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """Actions for one group or a batch, with the signature of Stable-Baselines3's policies.

        Args:
            observation: (followers, size) or (groups, followers, size).
            state: returned unchanged.
            episode_start: not used.
            deterministic: not used.

        Returns:
            Actions of the same leading shape and 3, float32, in units of each follower's max_accel_m_s2 and cut to
            [-1, 1]; and `state`.

        Raises:
            ValueError: the observation has another shape.
        """
        seen = np.asarray(observation, np.float32)
        shape = (self.scenario.followers, self.layout.size)
        if seen.shape[-2:] != shape or seen.ndim > 3:
            raise ValueError(f"observation: must be {shape} or (groups, {shape[0]}, {shape[1]}), got {seen.shape}")
        accelerations = self.acceleration(seen.reshape(-1, *shape))
        actions = np.clip(accelerations / self.limits_m_s2, -1.0, 1.0).astype(np.float32)
        return actions.reshape(*seen.shape[:-1], 3), state


class OwnLaws:
    """A law of one follower for each of a group.

    A law acts on the error that its observation shows, so it may be given another one.
    """

    def __init__(self, scenario: Scenario, name: str, error_weight_factor: float = 1.0) -> None:
        """Make the laws.

        Args:
            scenario: of several followers.
            name: of the law, in `baselines.POLICIES`.
            error_weight_factor: of the reward's weight of errors, for which the laws are designed.
        """
        made: dict[Any, AccelerationPolicy] = {}
        self._laws: list[AccelerationPolicy] = []
        for follower, own in enumerate(members(scenario)):
            alone = own[_typical_slot(scenario, follower)]
            kind = (alone.spacecraft, alone.sensor, alone.filter, alone.dropout)
            if kind not in made:
                reward = replace(alone.reward, error_weight=error_weight_factor * alone.reward.error_weight)
                made[kind] = make_policy(name, replace(alone, reward=reward))
            self._laws.append(made[kind])

    def acceleration(self, observation: Observations, errors: Array | None = None) -> Array:
        """Accelerations (groups, followers, 3), m/s^2.

        Args:
            observation: (groups, followers, size).
            errors: to act on in place of those observed (groups, followers, 6), in units of the observation.
        """
        if errors is not None:
            observation = observation.copy()
            observation[..., SLICES["error"]] = errors
        accelerations = [law.acceleration(observation[:, i]) for i, law in enumerate(self._laws)]
        return np.stack(accelerations, axis=1)


def _typical_slot(scenario: Scenario, follower: int) -> int:
    """The slot that a law is designed for: a follower's own, or if all are drawn, the opposite one.

    The law flies to any slot; of the swaps' slots this one's law cost least, all followers and slots considered.
    """
    return follower if scenario.slots == "fixed" else (follower + scenario.followers // 2) % scenario.followers


def neighbour_errors(observation: Observations, layout: ObservationLayout) -> tuple[Array, Array]:
    """Own errors and those of the neighbours, in units of the observation.

    Args:
        observation: (..., size).
        layout: of it.

    Returns:
        Own errors (..., 6) and the neighbours' (..., neighbours, 6); 0 of those that are gone.
    """
    own: Array = observation[..., SLICES["error"]].astype(float)
    differences = layout.neighbours(observation, "relative_estimate") - layout.neighbours(
        observation, "relative_reference"
    )
    present = layout.neighbours(observation, "present")[..., None]
    return own, present * (own[..., None, :] + differences / layout.state_scale)


def mean_error(observation: Observations, layout: ObservationLayout) -> Array:
    """Mean of own and neighbours' errors (..., 6), in units of the observation."""
    own, others = neighbour_errors(observation, layout)
    count: NDArray[np.float64] = 1.0 + layout.neighbours(observation, "present").sum(axis=-1)
    mean: Array = (own + others.sum(axis=-2)) / count[..., None]
    return mean
