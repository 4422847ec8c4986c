"""The plan of each row's step: the line of the schedule in, and what the observation shows of it."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.tile import STATE, WORK, WORK32, Work32, seen
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function
from formation_env.numerics.transpose import BLOCK, transpose_block

PLANNED: Final = seen("reference")
"""First element of the observation that depends on the plan alone; the scales stand behind the observation."""
NUM_PLANNED: Final = 10
NUM_SEEN: Final = NUM_PLANNED + Work32().scales


@inline_scalar
def eight_from(first: int, pitch: int) -> tuple[int, ...]:
    """Eight offsets, `pitch` apart."""
    return (
        first,
        first + pitch,
        first + 2 * pitch,
        first + 3 * pitch,
        first + 4 * pitch,
        first + 5 * pitch,
        first + 6 * pitch,
        first + 7 * pitch,
    )


@tile_function
def advance(state: Array, n: int) -> None:
    """Count the step."""
    for i in range(min(n, LANES)):
        state[STATE.step + i] += 1.0


@tile_function
def read_lines(
    table: NDArray[Any], first: int, size: int, lines: NDArray[np.intp], fields: NDArray[Any], place: int, n: int
) -> None:
    """Copy numbers of each row's line of a table into fields.

    Args:
        table: flat.
        first: where the numbers begin in a line.
        size: how many they are, 8 at least.
        lines: where each row's line begins (LANES,).
        fields: where they go, one field after the other.
        place: offset of the first field.
        n: rows.
    """
    whole = n - n % BLOCK
    for i in range(0, whole, BLOCK):
        for begin in range(0, size, BLOCK):
            k = min(begin, size - BLOCK)  # the last block overlaps the one before
            starts = (
                lines[i] + first + k,
                lines[i + 1] + first + k,
                lines[i + 2] + first + k,
                lines[i + 3] + first + k,
                lines[i + 4] + first + k,
                lines[i + 5] + first + k,
                lines[i + 6] + first + k,
                lines[i + 7] + first + k,
            )
            transpose_block(table, starts, fields, eight_from(place + k * LANES + i, LANES))
    for i in range(whole, n):
        for k in range(size):
            fields[place + k * LANES + i] = table[lines[i] + first + k]


@tile_function
def broadcast_line(table: NDArray[Any], first: int, size: int, fields: NDArray[Any], place: int, n: int) -> None:
    """Copy a line's numbers into the fields of all rows."""
    for k in range(size):
        value, field = table[first + k], fields[place + k * LANES :]
        for i in range(min(n, LANES)):
            field[i] = value


@tile_function
def read_plan(
    state: Array, work: Array, work32: Array32, schedule: Array, seen: Array32, known_line: int, n: int
) -> int:
    """Load the plan of each row's step; usually all are at one step, whose plan the scratch space may hold already.

    Args:
        state: the tile.
        work: scratch space.
        work32: scratch space.
        schedule: tables of all variants (variants, steps, columns).
        seen: what the observation shows of them (variants, steps, NUM_SEEN).
        known_line: line whose plan all rows of the scratch space have, or -1.
        n: rows.

    Returns:
        `known_line` after this call.
    """
    _, steps, columns = schedule.shape
    others = 0
    for i in range(min(n, LANES)):
        others += int(state[STATE.step + i] != state[STATE.step])
    for i in range(min(n, LANES)):
        others += int(state[STATE.variant + i] != state[STATE.variant])
    line: int = int(state[STATE.variant]) * steps + min(int(state[STATE.step]), steps - 1)
    if others == 0 and line == known_line:
        return known_line
    plans, views = schedule.reshape(-1), seen.reshape(-1)
    if others == 0 and n > 1:
        broadcast_line(plans, line * columns, columns, work, WORK.plan, n)
        broadcast_line(views, line * NUM_SEEN, NUM_PLANNED, work32, PLANNED, n)
        broadcast_line(views, line * NUM_SEEN + NUM_PLANNED, NUM_SEEN - NUM_PLANNED, work32, WORK32.scales, n)
        return line
    lines, own = np.empty(LANES, np.intp), np.empty(LANES, np.intp)
    for i in range(n):
        line = int(state[STATE.variant + i]) * steps + min(int(state[STATE.step + i]), steps - 1)
        lines[i], own[i] = line * columns, line * NUM_SEEN
    read_lines(plans, 0, columns, lines, work, WORK.plan, n)
    read_lines(views, 0, NUM_PLANNED, own, work32, PLANNED, n)
    for k in range(NUM_PLANNED, NUM_SEEN):
        for i in range(n):
            work32[WORK32.scales + (k - NUM_PLANNED) * LANES + i] = views[own[i] + k]
    return -1
