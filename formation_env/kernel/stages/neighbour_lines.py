"""The order of the neighbours in an observation, and its lines."""

import numpy as np

from formation_env.kernel.stages.neighbours import DISTANCE, FAR, ZERO, Lanes
from formation_env.kernel.stages.plan import eight_from
from formation_env.kernel.tile import WORK32
from formation_env.numerics.arrays import Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.numerics.transpose import BLOCK, transpose_block
from formation_env.task.observation import NEIGHBOUR_SIZE, SIZE


@tile_function
def rank(views: Array32, ranks: Lanes, n: int) -> None:
    """Place of each neighbour in the observation: the least predicted distance first, those that are gone last.

    Args:
        views: of all neighbours (others, VIEW_SIZE); the distance of those that are gone is then shown as 0.
        ranks: written (others, LANES).
        n: groups.
    """
    ranks[:] = 0
    for a in range(len(views)):
        for b in range(a + 1, len(views)):
            mine, its = views[a, DISTANCE:], views[b, DISTANCE:]
            first, second = ranks[a], ranks[b]
            for i in range(min(n, LANES)):
                later = np.intp(its[i] < mine[i])
                first[i] += later
                second[i] += 1 - later
    for a in range(len(views)):
        distance = views[a, DISTANCE:]
        for i in range(min(n, LANES)):
            distance[i] = distance[i] if distance[i] < FAR else ZERO


@inline_scalar
def _eight(places: Lanes, i: int, k: int) -> tuple[int, ...]:
    """Eight neighbouring places, moved by k."""
    return (
        places[i] + k,
        places[i + 1] + k,
        places[i + 2] + k,
        places[i + 3] + k,
        places[i + 4] + k,
        places[i + 5] + k,
        places[i + 6] + k,
        places[i + 7] + k,
    )


@tile_function
def write_lines(fields: Array32, first: int, size: int, target: Array32, places: Lanes, n: int) -> None:
    """Write neighbouring fields of each row side by side.

    Args:
        fields: of LANES numbers each.
        first: offset of the first.
        size: how many they are, 8 at least.
        target: flat.
        places: where each row's numbers go (LANES,).
        n: rows.
    """
    whole = n - n % BLOCK
    for i in range(0, whole, BLOCK):
        for begin in range(0, size, BLOCK):
            k = min(begin, size - BLOCK)
            transpose_block(fields, eight_from(first + k * LANES + i, LANES), target, _eight(places, i, k))
    for i in range(whole, n):
        for k in range(size):
            target[places[i] + k] = fields[first + k * LANES + i]


@tile_function
def collect(views: Array32, ranks: Lanes, target: Array32, starts: Lanes, n: int) -> None:
    """Write what each row sees of its neighbours, in the order of their ranks.

    Args:
        views: of all neighbours (others, VIEW_SIZE).
        ranks: their places (others, LANES).
        target: flat.
        starts: where each row's neighbours go (LANES,).
        n: groups.
    """
    places = np.empty(LANES, np.intp)
    for neighbour in range(len(views)):
        own = ranks[neighbour]
        for i in range(min(n, LANES)):
            places[i] = starts[i] + own[i] * NEIGHBOUR_SIZE
        write_lines(views[neighbour], 0, NEIGHBOUR_SIZE, target, places, n)


@tile_function
def write(
    work32: Array32, views: Array32, ranks: Lanes, lines: Array32, shown: int, target: Array32, starts: Lanes, n: int
) -> None:
    """Write observations.

    Args:
        work32: the rows' own part.
        views: of all neighbours.
        ranks: their places.
        lines: scratch space for all neighbours of LANES rows, a line each.
        shown: how many neighbours the observation shows.
        target: all observations, flat.
        starts: where those of the rows begin (LANES,).
        n: groups.
    """
    write_lines(work32, WORK32.observation, SIZE, target, starts, n)
    if shown == len(views):
        collect(views, ranks, target, starts + SIZE, n)
    else:
        width = len(views) * NEIGHBOUR_SIZE
        collect(views, ranks, lines, np.arange(LANES) * width, n)
        for i in range(n):
            for k in range(shown * NEIGHBOUR_SIZE):
                target[starts[i] + SIZE + k] = lines[i * width + k]
