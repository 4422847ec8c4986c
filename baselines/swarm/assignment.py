"""Who flies where: the followers' slots by least total delta-v."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from baselines.optimal.impulsive import impulsive_transfer
from formation_env.numerics.arrays import Array
from formation_env.task.members import members
from formation_env.task.scenario import Scenario

INSTANTS = 33
"""Instants of a transfer at which an impulse is allowed."""


def slot_costs(scenario: Scenario, starts: ArrayLike | None = None) -> Array:
    """Least delta-v from each follower's start to each slot of the first phase that has a transfer.

    By impulses at any of INSTANTS, and the filter's model. (Two impulses half an orbit apart, as in the shipped swarms,
    have no leverage cross-track.)

    Args:
        scenario: of several followers.
        starts: LVLH states (followers, 6) at the start of that transfer, m and m/s; None: the nominal ones at t = 0.

    Returns:
        m/s (followers, slots).

    Raises:
        ValueError: no phase has a transfer.
    """
    phase = next((index for index, each in enumerate(scenario.phases) if each.transfer_orbits > 0), None)
    if phase is None:
        raise ValueError("phases: none has a transfer, so there is nothing to assign")
    costs = np.empty((scenario.followers, scenario.followers))
    for follower, row in enumerate(members(scenario)):
        start = row[0].start.formation.state(row[0].orbit) if starts is None else np.asarray(starts, float)[follower]
        for slot, each in enumerate(row):
            linear = replace(each, dynamics=each.filter_model.dynamics)
            plan = impulsive_transfer(linear, phase=phase, initial_state=start, instants=INSTANTS)
            costs[follower, slot] = plan.delta_v_m_s
    return costs


def assign(scenario: Scenario, starts: ArrayLike | None = None) -> NDArray[np.intp]:
    """The slots (followers,) of least total delta-v, for `reset(options={"slots": ...})`; see `slot_costs`."""
    _, slots = linear_sum_assignment(slot_costs(scenario, starts))
    return slots
