"""Sliding mode control along the desired path."""

import numpy as np

from baselines.controllers.lookup import look_up, look_up_times
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.reaching import AnyReaching, ExponentialReaching, Relay
from baselines.controllers.search_space import Parameter
from baselines.controllers.surfaces import AnySurface, PlacedSurface
from baselines.design.guidance import Guidance, GuidanceName
from baselines.design.phase_tables import by_steps_left
from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, settings
from formation_env.task.scenario import Scenario


@settings
class SMCSettings:
    """Settings of `smc`.

    Attributes:
        guidance: the desired path, see `baselines.design.guidance`.
        surface: the sliding surface s = Ce e.
        reaching: how s comes to zero, by a reaching law or a relay.
        boundary_m: thickness Delta of the boundary layer, within which sgn s is replaced by s / Delta, m; 0 is none.
    """

    guidance: GuidanceName = "least_cost"
    surface: AnySurface = PlacedSurface()
    reaching: AnyReaching = ExponentialReaching()
    boundary_m: NonNegative = 50.0


class SMC(AccelerationPolicy):
    """u = (Ce Gamma)^-1 (Ce x_d(k+1) - Ce Phi x(k) - s(k+1)), s = Ce (x_d - x) (Ma 2009, eq. 4.59-4.61), or a relay."""

    name = "smc"
    Settings = SMCSettings
    settings: SMCSettings
    search_space = (
        *(Parameter((f"surface.decay_per_s.{axis}",), 3e-5, 3e-2) for axis in range(3)),
        Parameter(("reaching.eps_m_s",), 1e-4, 1),
        Parameter(("reaching.q_per_s",), 3e-5, 3e-2),
        Parameter(("boundary_m",), 0.1, 1e4),
    )
    proportional = True
    color, symbol = "#D55E00", "triangle-up"

    def __init__(self, scenario: Scenario, settings: SMCSettings) -> None:
        super().__init__(scenario, settings)
        self._guidance = Guidance(scenario, settings.guidance)
        model = scenario.filter_dynamics()
        first = model.steps(0, 1)
        self.Ce = settings.surface.Ce(DiscreteModel(first.Phi[0], first.Gamma[0], first.delta[0]), scenario.dt_s)
        self._path = self._guidance.residuals @ self.Ce.T
        self._Ce_Phi = by_steps_left(scenario, lambda leg: self.Ce @ model.steps(leg.start, leg.end).Phi)
        self._inverse = by_steps_left(
            scenario, lambda leg: np.linalg.inv(self.Ce @ model.steps(leg.start, leg.end).Gamma)
        )

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        now = self._guidance.track(observation)
        s, reaching = -now.error @ self.Ce.T, self.settings.reaching
        if isinstance(reaching, Relay):
            return reaching.u0_m_s2 * self.sign(s)
        # Ce x_d(k+1) - Ce Phi x(k) = Ce residual - Ce Phi (x - x_d): the path's own thrust, and the error's free motion
        free = look_up(self._path, now.at) - look_up_times(self._Ce_Phi, now.at, now.error)
        # s(k+1) by the reaching law (eq. 4.56)
        following = s + reaching.change(s, self.sign(s), self.scenario.dt_s)
        return look_up_times(self._inverse, now.at, free - following)

    def sign(self, s: Array) -> Array:
        """Sgn s (..., 3), or sat(s / Delta) with a boundary layer."""
        boundary = self.settings.boundary_m
        return np.clip(s / boundary, -1.0, 1.0) if boundary > 0 else np.sign(s)
