"""The content of a frame: the state of the flight, its trail, and the plan."""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.simulation import Simulation
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

MARGIN: Final = 1.16
"""Half the width of the view of a plan, in half widths of the plan."""
POINTS_PER_PERIOD: Final = 180
"""Points of a drawn reference path per orbit."""
TRAIL_PERIODS: Final = 0.5
"""Length of the trail, in orbits."""


@dataclass(frozen=True)
class Moment:
    """The state of a flight, as a frame shows it.

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
    """The present moment of the simulation's first row."""
    state = simulation.first_row_state
    xx, xy, yy = state("covariance_in_plane")[[0, 1, 4]]
    zz = state("covariance_cross_track")[0]
    return Moment(
        step=int(state("step")[0]),
        truth=state("true_state")[:3],
        estimate=state("estimate")[:3],
        covariance=np.array([[xx, xy, 0], [xy, yy, 0], [0, 0, zz]]),
        thrust=simulation.read("thrust")[0] / simulation.first_row_scenario.spacecraft.max_accel_m_s2,
        measured=bool(simulation.read("measured", dtype=bool)[0]),
        age_s=float(state("measurement_age")[0]),
        position_error_m=float(simulation.read("position_error")[0]),
        delta_v_m_s=float(state("sum_delta_v")[0]),
    )


class Trail:
    """The follower's positions at the last instants, whether or not they were drawn."""

    def __init__(self, scenario: Scenario) -> None:
        self._points: deque[tuple[Array, bool]] = deque(maxlen=max(2, scenario.steps(TRAIL_PERIODS)))

    def record(self, simulation: Simulation) -> None:
        """Add the present position of the simulation's first row."""
        received = bool(simulation.read("measured", dtype=bool)[0])
        self._points.append((simulation.first_row_state("true_state")[:3], not received))

    def clear(self) -> None:
        """Begin a new episode's trail."""
        self._points.clear()

    def positions(self) -> Array:
        """Positions (points, 3), m."""
        return np.array([position for position, _ in self._points])

    def lost(self) -> NDArray[np.bool_]:
        """Whether the measurement was lost at each of them (points,)."""
        return np.array([lost for _, lost in self._points])


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
        """The leg that scores the step to this instant."""
        return next(leg for leg in self.legs if step <= leg.end)

    def reference(self, step: int) -> Array:
        """Reference position (3,) at an instant, m."""
        return leg_reference(self._scenario, self.leg(step), np.asarray(step))[:3]
