"""The plan of an episode as a table: one row for each instant, the same for every episode of a scenario."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE, DiscreteModel
from formation_env.formations import Formation
from formation_env.numerics.arrays import Array
from formation_env.task.phases import Phase
from formation_env.task.reward import Scoring, scoring
from formation_env.task.scenario import Scenario

FIELDS: Final = {
    "reference": 6,  # reference state of the phase that is in force from this instant on, m and m/s
    "scored_position": 3,  # reference position of the phase that the step to this instant belongs to, m
    "coast_in_plane": 16,  # transition matrix to the arrival by the filter's model, row by row
    "coast_cross_track": 4,
    "coast_offset": 6,  # to be added, so that the error at the arrival comes out
    "time_to_arrival": 1,  # in periods; 0 in hold
    "in_hold": 1,
    "phase": 1,  # index
    "time_left": 1,  # to the end of the phase, in periods
    "link_closed": 1,  # 1 while a dropout window is open
    "error_weight": 1,  # weight of the error at this instant, (m/s) per m
    "weight_left": 1,  # sum of the later weights
    "counts": 1,  # 1 if the step to this instant belongs to a hold
    "counts_left": 1,  # later steps that do
    "arrives": 1,  # 1 / number of transfers if one ends at this instant; without any, the start counts
    "arrives_left": 1,  # sum of the later ones
}

SCALES: Final = ("per_length", "per_speed", "per_step", "per_log_age")
"""Scales of the observation: units per m, m/s and s, and of the logarithm of an age in steps."""


def _offsets() -> dict[str, int]:
    ends = np.cumsum(list(FIELDS.values()))
    return {name: int(end) - size for (name, size), end in zip(FIELDS.items(), ends, strict=True)}


OFFSETS: Final = _offsets()
WIDTH: Final = sum(FIELDS.values())


@dataclass(frozen=True)
class Leg:
    """A phase on the clock, in steps: it is in force from start to end, and must be there at arrival."""

    index: int
    phase: Phase
    start: int
    arrival: int
    end: int


def legs(scenario: Scenario) -> list[Leg]:
    """The phases of a scenario on the clock."""
    result, start = [], 0
    for index, phase in enumerate(scenario.phases):
        arrival = start + scenario.steps(phase.transfer_orbits)
        end = arrival + scenario.steps(phase.hold_orbits)
        result.append(Leg(index, phase, start, arrival, end))
        start = end
    return result


def leg_reference(scenario: Scenario, leg: Leg, steps: ArrayLike, slot: Formation | None = None) -> Array:
    """Reference states (..., 6) of a leg at instants (...), in steps: on the way to the arrival and after it.

    Args:
        scenario: the scenario.
        leg: one of its legs.
        steps: instants (...).
        slot: the formation of one of several followers; None: the leg's.
    """
    times_s = np.asarray(steps) * scenario.dt_s
    formation = slot or leg.phase.formation
    return formation.reference(times_s, scenario.orbit, leg.arrival * scenario.dt_s)


def score_table(scenario: Scenario) -> Scoring:
    """Scoring of the error at each instant."""
    plan = legs(scenario)
    return scoring(scenario.reward, [leg.arrival for leg in plan], [leg.end for leg in plan], scenario.dt_s)


def build_schedule(scenario: Scenario) -> Array:
    """The table (num_steps + 1, WIDTH); the columns are `FIELDS`."""
    table, scores = np.zeros((scenario.num_steps + 1, WIDTH)), score_table(scenario)
    column(table, "error_weight")[:], column(table, "counts")[:] = scores.error_weight, scores.in_hold
    for leg in legs(scenario):
        _fill_plan(table, scenario, leg)
        scored = np.flatnonzero(scores.leg == leg.index)
        columns(table, "scored_position")[scored] = leg_reference(scenario, leg, scored)[:, :3]
    arrivals = [leg.arrival for leg in legs(scenario) if leg.arrival > leg.start] or [0]
    column(table, "arrives")[arrivals] = 1 / len(arrivals)
    times_s: Array = scenario.dt_s * np.arange(len(table), dtype=float)
    column(table, "link_closed")[:] = scenario.dropout.closed(times_s)
    for name, left in (("error_weight", "weight_left"), ("counts", "counts_left"), ("arrives", "arrives_left")):
        added = column(table, name)
        column(table, left)[:] = np.cumsum(added[::-1])[::-1] - added
    return table


def column(table: Array, name: str) -> Array:
    """A field of one number, of all instants (num_steps + 1,); a view of the table."""
    return table[:, OFFSETS[name]]


def columns(table: Array, name: str) -> Array:
    """A field of several numbers, of all instants (num_steps + 1, FIELDS[name]); a view of the table."""
    return table[:, OFFSETS[name] : OFFSETS[name] + FIELDS[name]]


def coast_matrices(table: Array) -> Array:
    """Transition matrices (num_steps + 1, 6, 6) from each instant to the arrival, by the filter's model."""
    A = np.zeros((len(table), 6, 6))
    for name, axes in (("coast_in_plane", IN_PLANE), ("coast_cross_track", CROSS_TRACK)):
        A[:, axes[:, None], axes] = columns(table, name).reshape(-1, len(axes), len(axes))
    return A


def _fill_plan(table: Array, scenario: Scenario, leg: Leg) -> None:
    """Fill in the plan from each instant of the leg on (its end belongs to the next leg, if there is one)."""
    steps = np.arange(leg.start, leg.end + 1)
    in_force = slice(leg.start, leg.end + 1)
    reference = leg_reference(scenario, leg, steps)
    coast_steps = np.maximum(leg.arrival - steps, 0)
    Phi, delta = _coasts(scenario.filter_dynamics().steps(leg.start, leg.arrival))
    goal = leg_reference(scenario, leg, np.maximum(steps, leg.arrival))
    columns(table, "reference")[in_force] = reference
    columns(table, "coast_in_plane")[in_force] = Phi[np.ix_(coast_steps, IN_PLANE, IN_PLANE)].reshape(-1, 16)
    columns(table, "coast_cross_track")[in_force] = Phi[np.ix_(coast_steps, CROSS_TRACK, CROSS_TRACK)].reshape(-1, 4)
    columns(table, "coast_offset")[in_force] = delta[coast_steps] - goal
    period_s = scenario.orbit.period_s
    column(table, "time_to_arrival")[in_force] = coast_steps * scenario.dt_s / period_s
    column(table, "in_hold")[in_force] = steps >= leg.arrival
    column(table, "phase")[in_force] = leg.index
    column(table, "time_left")[in_force] = (leg.end - steps) * scenario.dt_s / period_s


def _coasts(model: DiscreteModel) -> tuple[Array, Array]:
    """Coasting through the last 0 to count steps.

    Args:
        model: of each step (count, ...).

    Returns:
        Transition matrices (count + 1, 6, 6) and the effects of the constant disturbance (count + 1, 6).
    """
    count = len(model.Phi)
    Phi, delta = np.tile(np.eye(6), (count + 1, 1, 1)), np.zeros((count + 1, 6))
    for k in range(count):
        step = count - 1 - k
        Phi[k + 1] = Phi[k] @ model.Phi[step]
        delta[k + 1] = Phi[k] @ model.delta[step] + delta[k]
    return Phi, delta
