"""What a frame shows: the state of the flight, and the plan behind it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.simulation import Simulation
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

MARGIN: Final = 1.16
"""Half the width of the view of a plan, in half widths of the plan."""
POINTS_PER_PERIOD: Final = 180
"""Of a drawn reference path."""


@dataclass(frozen=True)
class Moment:
    """What a frame shows.

    Attributes:
        step: steps since the start.
        truth: position (3,), m.
        estimate: position (3,), m.
        covariance: of the estimated position (3, 3), m^2.
        thrust: acceleration (3,) in units of max_accel_m_s2.
        measured: whether the last measurement arrived.
        age_s: time since the last one that did, s.
        position_error_m: distance from the reference, m.
        delta_v_m_s: used since the start, m/s.
    """

    step: int
    truth: Array
    estimate: Array
    covariance: Array
    thrust: Array
    measured: bool
    age_s: float
    position_error_m: float
    delta_v_m_s: float


def read_moment(simulation: Simulation) -> Moment:
    """What the simulation's first row shows now."""
    in_plane, z_variance = simulation.row_state(field.P_IN_PLANE, 10), simulation.row_state(field.P_CROSS_TRACK, 1)[0]
    xx, xy, yy = in_plane[[0, 1, 4]]
    first = (field.THRUST - field.RESULTS) // LANES
    return Moment(
        step=int(simulation.row_state(field.STEP, 1)[0]),
        truth=simulation.row_state(field.TRUTH, 3),
        estimate=simulation.row_state(field.ESTIMATE, 3),
        covariance=np.array([[xx, xy, 0], [xy, yy, 0], [0, 0, z_variance]]),
        thrust=simulation.results[first : first + 3, 0] / simulation.flown.spacecraft.max_accel_m_s2,
        measured=bool(simulation.result(field.MEASURED)[0] > 0.5),
        age_s=float(simulation.row_state(field.AGE, 1)[0]),
        position_error_m=float(simulation.result(field.POSITION_ERROR)[0]),
        delta_v_m_s=float(simulation.row_state(field.SUM_DELTA_V, 1)[0]),
    )


class Plan:
    """The scenario's references, for drawing.

    Attributes:
        centre: of all references, start and leader (3,), m.
        half_m: half the width that shows them all, m.
        legs: the phases on the clock.
        paths: reference positions (points, 3) of each leg, m.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.legs = legs(scenario)
        self.paths = [self._path(leg) for leg in self.legs]
        start = scenario.start.formation.state(scenario.orbit)[:3]
        points = np.vstack([*self.paths, start, np.zeros(3)])
        low, high = points.min(axis=0), points.max(axis=0)
        self.centre = (low + high) / 2
        self.half_m = MARGIN * max(float((high - low).max()) / 2, 4 * scenario.tolerance_m)

    def _path(self, leg: Leg) -> Array:
        """Reference positions (points, 3) over the leg, and one period at least, m."""
        period = self._scenario.orbit.period_s / self._scenario.dt_s
        end = max(leg.end, leg.start + period)
        steps = np.linspace(leg.start, end, 1 + round(POINTS_PER_PERIOD * (end - leg.start) / period))
        return leg_reference(self._scenario, leg, steps)[:, :3]

    def leg(self, step: int) -> Leg:
        """The leg that the step to this instant is judged by."""
        return next(leg for leg in self.legs if step <= leg.end)

    def reference(self, step: int) -> Array:
        """Reference position (3,) at an instant, m."""
        return leg_reference(self._scenario, self.leg(step), np.asarray(step))[:3]
