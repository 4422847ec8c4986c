"""Tables that policies look up by phase and by steps left to the phase's end."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.task.observation import ObservationLayout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

Instants = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Phases (...) and steps left to their ends (...), which index the tables of `by_steps_left`."""


def read_instants(observation: NDArray[np.floating], layout: ObservationLayout, dt_s: float) -> Instants:
    """Phase and steps left of observations (..., SIZE).

    Args:
        observation: (..., SIZE).
        layout: of the observations.
        dt_s: time step, s.
    """
    steps_left = np.rint(layout.scalar(observation, "time_left") * (layout.period_s / dt_s))
    return layout.phase(observation), steps_left.astype(np.intp)


def by_steps_left(scenario: Scenario, values: Callable[[Leg], NDArray[np.floating]]) -> Array:
    """Tabulate values (phases, steps left, ...) of each instant; 0 where a phase has none.

    Args:
        scenario: gives the phases.
        values: gives the values (count, ...) of a phase, from its beginning on.
    """
    plan = legs(scenario)
    parts = [values(leg) for leg in plan]
    longest = max(leg.end - leg.start for leg in plan)
    table = np.zeros((len(plan), longest + 1, *parts[0].shape[1:]))
    for leg, part in zip(plan, parts, strict=True):
        table[leg.index, leg.end - leg.start - np.arange(len(part))] = part
    return table


def nominal_start(scenario: Scenario, leg: Leg) -> Array:
    """Nominal state (6,) at a phase's beginning: the reference of the phase before, or the scenario's start."""
    if leg.index == 0:
        return scenario.start.formation.state(scenario.orbit)
    return leg_reference(scenario, legs(scenario)[leg.index - 1], np.array(leg.start))


def start_error(scenario: Scenario, leg: Leg) -> Array:
    """Nominal error (6,) from the reference at a phase's beginning."""
    return nominal_start(scenario, leg) - leg_reference(scenario, leg, np.array(leg.start))


def transfer_reference(scenario: Scenario, leg: Leg) -> Array:
    """Reference states (steps + 1, 6) from a phase's beginning to its arrival."""
    return leg_reference(scenario, leg, np.arange(leg.start, leg.arrival + 1))
