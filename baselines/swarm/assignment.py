"""Who flies where: the followers' slots by least total delta-v."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from baselines.design.transfers import two_impulse
from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array
from formation_env.task.members import members
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs


def slot_costs(scenario: Scenario, starts: ArrayLike | None = None) -> Array:
    """Delta-v of two impulses from each follower's start to each slot, by the filter's model.

    Args:
        scenario: of several followers; the first phase with a transfer counts.
        starts: LVLH states (followers, 6) at the start of that transfer, m and m/s; None: the nominal ones at t = 0.

    Returns:
        m/s (followers, slots).

    Raises:
        ValueError: no phase has a transfer, or two impulses do not reach a slot in its time.
    """
    own = members(scenario)
    leg = next((leg for leg in legs(scenario) if leg.arrival > leg.start), None)
    if leg is None:
        raise ValueError("phases: none has a transfer, so there is nothing to assign")
    time_s = (leg.arrival - leg.start) * scenario.dt_s
    if starts is None:
        starts = [row[0].start.formation.state(row[0].orbit) for row in own]
    steps = own[0][0].filter_dynamics().steps(leg.start, leg.arrival).from_start()
    model = DiscreteModel(steps.Phi[-1], steps.Gamma[-1], steps.delta[-1])
    costs = np.empty((scenario.followers, scenario.followers))
    for slot, each in enumerate(own[0]):
        goal = leg_reference(each, legs(each)[leg.index], leg.arrival)
        for follower, start in enumerate(np.asarray(starts, float)):
            transfer = two_impulse(model, time_s, scenario.orbit.mean_motion_rad_s, start, goal)
            costs[follower, slot] = transfer.delta_v_m_s
    return costs


def assign(scenario: Scenario, starts: ArrayLike | None = None) -> NDArray[np.intp]:
    """The slots (followers,) of least total delta-v, for `reset(options={"slots": ...})`; see `slot_costs`."""
    _, slots = linear_sum_assignment(slot_costs(scenario, starts))
    return slots
