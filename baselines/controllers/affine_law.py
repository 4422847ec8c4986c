"""Tabulated affine laws of the estimated state: the common form of the regulators along a path."""

import numpy as np

from baselines.controllers.lookup import look_up, look_up_times
from baselines.design.phase_tables import Instants, by_steps_left, read_instants
from formation_env.numerics.arrays import Array, Observations
from formation_env.task.observation import SLICES, observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference


class AffineLaw:
    """u = u_d - K (x_hat - x_d), looked up by phase and steps left.

    It is kept as u = b - G o with the observation's own numbers o of the state, so that a call has no units to convert
    and no path to subtract: G = K diag(scale), b = u_d + K x_d.
    """

    def __init__(self, scenario: Scenario, K: Array, desired: Array, thrust: Array) -> None:
        """Fold the path and the units into the tables.

        Args:
            scenario: gives the phases and the units of the observation.
            K: gains (phases, steps left, 3, 6), m/s^2 per m and m/s.
            desired: x_d (phases, steps left, 6), m and m/s.
            thrust: u_d (phases, steps left, 3), m/s^2.
        """
        self._layout, self._dt_s = observation_layout(scenario), scenario.dt_s
        self._gain, self._bias = K * self._layout.state_scale, thrust + (K @ desired[..., None])[..., 0]

    def instants(self, observation: Observations) -> Instants:
        """Phase and steps left of observations (..., SIZE), within the tables."""
        phase, steps_left = read_instants(observation, self._layout, self._dt_s)
        return phase, np.clip(steps_left, 0, self._bias.shape[1] - 1)

    def acceleration(self, states: Array, at: Instants) -> Array:
        """Accelerations (..., 3), m/s^2, for states (..., 6) in units of the observation."""
        return look_up(self._bias, at) - look_up_times(self._gain, at, states)


def shown(observation: Observations, block: str) -> Array:
    """States (..., 6) of a block of observations (..., SIZE), in their units, in double precision."""
    states: Array = observation[..., SLICES[block]].astype(np.float64)
    return states


def reference_table(scenario: Scenario) -> Array:
    """Reference states (phases, steps left, 6), m and m/s; a desired state less this goes with the block `error`."""
    return by_steps_left(scenario, lambda leg: leg_reference(scenario, leg, np.arange(leg.start, leg.end + 1)))
