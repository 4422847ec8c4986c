"""The nearest acceleration within half-spaces and limits."""

import numpy as np

from formation_env.numerics.arrays import Array


def least_change(wanted: Array, normals: Array, least: Array, limits: Array, sweeps: int) -> Array:
    """The nearest accelerations to those wanted with normals . a >= least, within limits per axis.

    Dykstra's alternating projections (Boyle & Dykstra 1986); where no acceleration satisfies all, the limits win.

    Args:
        wanted: (..., 3).
        normals: unit vectors (..., constraints, 3).
        least: (..., constraints); -inf for none.
        limits: broadcast to (..., 3).
        sweeps: over all constraints.
    """
    a, count = wanted.copy(), normals.shape[-2]
    multipliers = np.zeros(least.shape)
    correction = np.zeros(wanted.shape)
    for _ in range(sweeps):
        for index in range(count):
            normal = normals[..., index, :]
            freed = a - multipliers[..., index, None] * normal
            multipliers[..., index] = np.maximum(least[..., index] - np.vecdot(normal, freed), 0.0)
            a = freed + multipliers[..., index, None] * normal
        freed = a + correction
        a = np.clip(freed, -limits, limits)
        correction = freed - a
    return np.clip(a, -limits, limits)
