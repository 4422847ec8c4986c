"""Entries of the tables of `by_steps_left` at rows' instants, and their products with the rows' vectors.

`table[at]` and `table[at] @ vectors[..., None]` mean the same, but for a thousand rows they take two and four times as
long, which is most of a policy's time.
"""

import numpy as np
from numpy.typing import NDArray

from baselines.design.phase_tables import Instants
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import compiled_loop


def look_up(table: Array, at: Instants) -> Array:
    """Entries (..., *shape) of a table (phases, steps left, *shape) at instants (...) that lie within it."""
    entries: Array = table.reshape(-1, *table.shape[2:]).take(_places(table, at), axis=0)
    return entries


def look_up_times(table: Array, at: Instants, vectors: Array) -> Array:
    """Products (..., m) of a table's matrices (phases, steps left, m, n) at instants (...) with vectors (..., n).

    A row's product has the same bits whatever rows are beside it.

    Raises:
        IndexError: a phase lies outside the table.
    """
    m, n = table.shape[2:]
    places = _places(table, at)
    products = _products(table.reshape(-1, m, n), places.reshape(-1), vectors.reshape(-1, n))
    return products.reshape(*places.shape, m)


def _places(table: Array, at: Instants) -> NDArray[np.intp]:
    """Places (...) of instants in a table whose first two axes are made one."""
    phase, steps_left = at
    return np.asarray(phase * table.shape[1] + steps_left)


@compiled_loop
def _products(matrices: Array, places: NDArray[np.intp], vectors: Array) -> Array:
    """Products (rows, m) of the matrices (count, m, n) at some places (rows,) with vectors (rows, n)."""
    products = np.zeros((len(places), matrices.shape[1]))
    for row, place in enumerate(places):
        if not 0 <= place < len(matrices):
            raise IndexError("a phase lies outside the table")
        for i in range(matrices.shape[1]):
            for j in range(matrices.shape[2]):
                products[row, i] += matrices[place, i, j] * vectors[row, j]
    return products
