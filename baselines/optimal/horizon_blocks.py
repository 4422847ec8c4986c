"""Blocks of a receding horizon: short ones first, longer ones later, none across an arrival or a phase's end."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.task.schedule import Leg


def horizon_end(plan: Sequence[Leg], instant: int, hold_steps: int) -> int:
    """The instant until which so many steps of hold will have passed, or the end of the last phase."""
    left = hold_steps
    for leg in plan:
        begin = max(leg.arrival, instant)
        held = max(0, leg.end - begin)
        if held >= left:
            return begin + left
        left -= held
    return plan[-1].end


def block_ends(
    plan: Sequence[Leg], instant: int, last: int, *, finest: int, coarsest: int, growth: float
) -> NDArray[np.intp]:
    """Instants (N + 1,) from now to the last, between which the thrust is constant.

    Args:
        plan: the phases.
        instant: now, in steps.
        last: end of the horizon.
        finest: least steps of a block.
        coarsest: most steps of a block.
        growth: steps of a block over those from now to its beginning, between the two.
    """
    stops = sorted({stop for leg in plan for stop in (leg.arrival, leg.end) if instant < stop < last} | {last})
    nodes = [instant]
    for stop in stops:
        while nodes[-1] < stop:
            grown = int(growth * (nodes[-1] - instant))
            nodes.append(min(nodes[-1] + min(max(grown, finest), coarsest), stop))
    return np.array(nodes)


def shared_error_weights(error_weight: Array, leg: NDArray[np.intp], nodes: NDArray[np.intp]) -> Array:
    """Weights (N,) of the errors at the blocks' ends, so that errors in between count as if on a straight line.

    An error before the first block's end, or scored by another phase than the block's start, counts at the block's end.

    Args:
        error_weight: of the error at each instant of the episode (instants,).
        leg: phase that scores each instant (instants,), see `task.reward.Scoring`.
        nodes: the blocks' ends (N + 1,), in steps.
    """
    steps = np.arange(nodes[0] + 1, nodes[-1] + 1)
    block = np.searchsorted(nodes, steps) - 1
    start, end = nodes[block], nodes[block + 1]
    early = np.where((block > 0) & (leg[start] == leg[steps]), (end - steps) / (end - start), 0.0)
    late_shares = np.bincount(block + 1, (1 - early) * error_weight[steps], len(nodes))
    return np.asarray((late_shares + np.bincount(block, early * error_weight[steps], len(nodes)))[1:], float)
