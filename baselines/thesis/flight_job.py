"""Flights as data: jobs for `baselines.experiments.parallel`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from baselines.controllers.policy import AccelerationPolicy
from baselines.design.guidance import GuidanceName
from baselines.thesis import scenarios
from baselines.thesis.fly_laws import FEW, fly_laws
from baselines.thesis.recorded_flights import Flights
from formation_env.task.scenario import Scenario

_ENVIRONMENT_COST: Final = 2
"""Duration of a batch's step, in steps of one law."""


@dataclass(frozen=True)
class Law:
    """A control law with the thesis's settings, see `scenarios.law`.

    Attributes:
        name: of the policy.
        shipped: gain file.
        control_s2: factor of the control weight in place of the printed one, s^2.
    """

    name: str
    shipped: str
    control_s2: float | None = None

    def make(self, scenario: Scenario) -> AccelerationPolicy:
        """Policy for a scenario."""
        return scenarios.law(self.name, scenario, self.shipped, self.control_s2)


@dataclass(frozen=True)
class FlightJob:
    """One batch of flights; the fields are the arguments of `fly_laws`.

    Attributes:
        scenario: scenario flown.
        laws: laws that fly it.
        seeds: one per episode of each law.
        guide: the desired path that errors are measured from.
        every: steps between recorded instants.
        few: seeds whose states are recorded.
        measured: whether their measurements are recorded.
        start: true state (6,) to start at, if not the scenario's.
    """

    scenario: Scenario
    laws: tuple[Law, ...]
    seeds: tuple[int, ...]
    guide: GuidanceName = "automatic"
    every: int = 1
    few: int = FEW
    measured: bool = False
    start: tuple[float, ...] | None = None

    @property
    def cost(self) -> int:
        """Duration in steps of one law; the number of seeds hardly matters."""
        return self.scenario.num_steps * (_ENVIRONMENT_COST + len(self.laws))

    def run(self, progress: Callable[[int], Any]) -> Flights:
        """Fly it; progress is called with the cost completed since the last call."""
        share = _ENVIRONMENT_COST + len(self.laws)
        return fly_laws(
            [law.make(self.scenario) for law in self.laws],
            self.scenario,
            self.seeds,
            self.guide,
            self.every,
            self.few,
            self.measured,
            None if self.start is None else np.array(self.start),
            lambda _: progress(share),
        )
