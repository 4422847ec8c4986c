"""Scratch space of the compiled step of groups."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.stages import neighbours
from formation_env.kernel.tile import WORK32_SIZE, WORK_SIZE
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, tile_function
from formation_env.task.observation import NEIGHBOUR_SIZE
from formation_env.task.schedule import WIDTH

Rows = NDArray[np.intp]


class Scratch(NamedTuple):
    """Scratch space of a block of groups.

    Attributes:
        works: of each follower, double.
        works32: likewise, single.
        known: what followers know of one another (followers, `neighbours.KNOWN_SIZE`).
        views: of the neighbours of each follower (followers, followers - 1, `neighbours.VIEW_SIZE`).
        spare_view: one more.
        lines: for the observations' parts of all neighbours.
        ranks: of the neighbours (followers - 1, LANES).
        lanes: groups in which a pair does not hear each other (pairs, LANES).
        deaf: how many these are (pairs,).
    """

    works: Array
    works32: Array32
    known: Array32
    views: Array32
    spare_view: Array32
    lines: Array32
    ranks: Rows
    lanes: Rows
    deaf: Rows


def scratch_sizes(columns: int, count: int) -> tuple[int, int, int]:
    """How many numbers of scratch space a block needs: double, single and whole.

    Args:
        columns: of the schedule.
        count: followers.
    """
    others = count - 1
    views = (count * others + 1) * neighbours.VIEW_SIZE + LANES * others * NEIGHBOUR_SIZE
    return (
        count * (WORK_SIZE + (columns - WIDTH) * LANES),
        count * (WORK32_SIZE + neighbours.KNOWN_SIZE) + views,
        count * others // 2 * (LANES + 1) + others * LANES,
    )


@tile_function
def group_scratch(numbers: Array, numbers32: Array32, integers: Rows, count: int) -> Scratch:
    """Divide scratch space of `scratch_sizes`."""
    others, pairs = count - 1, count * (count - 1) // 2
    known = count * WORK32_SIZE
    views = known + count * neighbours.KNOWN_SIZE
    spare = views + count * others * neighbours.VIEW_SIZE
    lines = spare + neighbours.VIEW_SIZE
    return Scratch(
        numbers.reshape(count, -1),
        numbers32[:known].reshape(count, WORK32_SIZE),
        numbers32[known:views].reshape(count, neighbours.KNOWN_SIZE),
        numbers32[views:spare].reshape(count, others, neighbours.VIEW_SIZE),
        numbers32[spare:lines],
        numbers32[lines:],
        integers[: others * LANES].reshape(others, LANES),
        integers[others * LANES : (others + pairs) * LANES].reshape(pairs, LANES),
        integers[(others + pairs) * LANES :],
    )
