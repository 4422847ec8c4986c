"""The five control architectures of a formation that Ma (2009) names, each on top of laws of one follower.

An architecture says which error a follower acts on: its own, or one that the others' errors enter, which it knows by
their messages.
"""

import numpy as np

from baselines.swarm.policy import OwnLaws, SwarmPolicy, mean_error, neighbour_errors
from formation_env.dynamics.hcw import HCW
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, Probability, settings
from formation_env.task.observation import SLICES
from formation_env.task.scenario import Scenario


@settings
class ArchitectureSettings:
    """Settings of the architectures.

    Attributes:
        law: each follower's own law, in `baselines.POLICIES`.
        coupling: mimo: weight of a difference between two followers' errors, in units of that of an error.
        structure: virtual_structure: share of the fitted displacement of the formation that is corrected.
        following: cyclic: share of the next follower's error that a follower takes over.
        spacing: behavioural: weight of the spacing; that of the goal is 1.
    """

    law: str = "lqr"
    coupling: NonNegative = 0.25
    structure: Probability = 0.5
    following: Probability = 0.3
    spacing: NonNegative = 0.2


class LeaderFollower(SwarmPolicy):
    """Each follower flies on its own, as if it were alone with the leader."""

    name = "leader_follower"

    def __init__(self, scenario: Scenario, settings: ArchitectureSettings) -> None:
        super().__init__(scenario)
        self.settings, self._laws = settings, OwnLaws(scenario, settings.law)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        return self._laws.acceleration(observation)


class MIMO(LeaderFollower):
    """One regulator of the stacked state whose cost has the differences between followers' errors, too.

    For N followers alike, with weights Q of an error and w Q of a difference, the regulator of the stacked state splits
    into one of the mean error, with Q, and one of what differs from it, with (1 + N w) Q.
    """

    name = "mimo"

    def __init__(self, scenario: Scenario, settings: ArchitectureSettings) -> None:
        super().__init__(scenario, settings)
        factor = 1 + scenario.followers * settings.coupling
        self._relative_laws = OwnLaws(scenario, settings.law, error_weight_factor=factor)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2; the laws are affine, so a difference of two is linear."""
        mean = mean_error(observation, self.layout)
        of_difference = self._relative_laws.acceleration(observation) - self._relative_laws.acceleration(
            observation, mean
        )
        difference: Array = self._laws.acceleration(observation, mean) + of_difference
        return difference


class VirtualStructure(LeaderFollower):
    """Phase and size of the formation are fitted to all estimates; each follower tracks its place there.

    The formation as a whole returns to the plan more slowly, which saves fuel. In transfers, where the structure is yet
    to be built, each follower flies on its own.
    """

    name = "virtual_structure"

    def __init__(self, scenario: Scenario, settings: ArchitectureSettings) -> None:
        super().__init__(scenario, settings)
        A, scale = HCW().state_matrix(scenario.orbit, scenario.spacecraft), self.layout.state_scale
        self._rates = A * scale / scale[:, None] / scenario.orbit.mean_motion_rad_s

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        own, others = neighbour_errors(observation, self.layout)
        reference = self.layout.state(observation, "reference")[..., None, :]
        ahead = self.layout.neighbours(observation, "relative_reference")
        present = self.layout.neighbours(observation, "present")[..., None]
        places = np.concatenate([reference, present * (reference + ahead)], axis=-2) / self.layout.state_scale
        errors = np.concatenate([own[..., None, :], others], axis=-2)
        # e = size r + shift r', least squares over all followers; r' = A r
        rates = places @ self._rates.T
        design = np.stack([places, rates], axis=-1)
        fitted = np.linalg.pinv(design.reshape(*own.shape[:-1], -1, 2)) @ errors.reshape(*own.shape[:-1], -1, 1)
        displacement = (design[..., 0, :, :] @ fitted)[..., 0]
        in_hold = observation[..., SLICES["in_hold"]]
        return self._laws.acceleration(observation, own - in_hold * (1 - self.settings.structure) * displacement)


class Cyclic(LeaderFollower):
    """Each follower tracks the next: it takes over a share of its error, so that the two keep their distance."""

    name = "cyclic"

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        own, others = neighbour_errors(observation, self.layout)
        ahead = self.layout.neighbours(observation, "relative_reference")
        course = self.layout.state(observation, "reference")[..., None, 3:]
        # the nearest place of those in the direction of flight, or of all if none is there
        behind = np.vecdot(ahead[..., :3], course) <= 0
        gone = self.layout.neighbours(observation, "present") == 0
        distance = np.linalg.norm(ahead[..., :3], axis=-1) + 1e6 * behind + 1e9 * gone
        following = np.take_along_axis(others, distance.argmin(axis=-1)[..., None, None], axis=-2)[..., 0, :]
        return self._laws.acceleration(observation, own - self.settings.following * following)


class Behavioural(LeaderFollower):
    """A weighted sum of behaviours: reach the goal, keep the spacing to all others; avoidance is the layer above."""

    name = "behavioural"

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        goal = self._laws.acceleration(observation)
        spacing = goal - self._laws.acceleration(observation, mean_error(observation, self.layout))
        weighted: Array = goal + self.settings.spacing * spacing
        return weighted


ARCHITECTURES = {policy.name: policy for policy in (LeaderFollower, MIMO, VirtualStructure, Cyclic, Behavioural)}
"""All architectures, by name."""
