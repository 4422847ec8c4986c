"""Where neighbours are that are not heard, by their plan."""

import numpy as np

from formation_env.dynamics.hcw import transition_matrix
from formation_env.numerics.arrays import Array, Observations
from formation_env.task.observation import ObservationLayout

LEAST_LEVERAGE = 0.05
"""Least leverage of an impulse on an axis, over the greatest, with which it counts as planned."""


def by_plan(observation: Observations, layout: ObservationLayout) -> Array:
    """Relative states of the neighbours (..., neighbours, 6), m and m/s: of those not heard now, by their plan.

    A message from before a burn says little of where its sender goes. The plan, which all know, does: in a transfer,
    whoever is not heard is taken to have left its last message's place by the impulse that leads to its slot.
    """
    relative = layout.neighbours(observation, "relative_estimate")
    age_s = layout.neighbours(observation, "message_age")
    time_left_s = np.broadcast_to(layout.time_to_arrival_s(observation)[..., None], age_s.shape)
    rows = (age_s > layout.dt_s / 2) & (time_left_s > layout.dt_s / 2)
    if not rows.any():
        return relative
    n, age_s, left_s = layout.mean_motion_rad_s, age_s[rows], time_left_s[rows]
    own = np.broadcast_to(layout.estimate(observation)[..., None, :], relative.shape)[rows]
    slots = layout.state(observation, "reference")[..., None, :] + layout.neighbours(observation, "relative_reference")
    sent = np.matvec(transition_matrix(n, -age_s), relative[rows] + own)
    goal = np.matvec(transition_matrix(n, left_s), slots[rows])
    Phi = transition_matrix(n, left_s + age_s)
    miss = (goal - np.matvec(Phi, sent))[:, :3]
    sent[:, 3:] += np.matvec(np.linalg.pinv(Phi[:, :3, 3:], rcond=LEAST_LEVERAGE), miss)
    relative[rows] = np.matvec(transition_matrix(n, age_s), sent) - own
    return relative
