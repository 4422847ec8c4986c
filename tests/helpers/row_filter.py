"""The kernel's two filters of a row, in the orbit plane and across, as one of six states."""

import numba
import numpy as np
from oracles import Array

from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE
from formation_env.kernel import kalman
from formation_env.navigation.filter_settings import upper_triangle

Row = tuple[float, ...]
Pair = tuple[float, float]
Update = tuple[Row, Row, float]

BOTH, POSITION, NOTHING = (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)


@numba.njit
def time_update(P4: Row, Phi4: Row, Q4: Row, P2: Row, Phi2: Row, Q2: Row) -> tuple[Row, Row]:
    return kalman.time_update_4(P4, Phi4, Q4), kalman.time_update_2(P2, Phi2, Q2)


@numba.njit
def measurement_update(
    x4: Row, P4: Row, z4: Row, x2: Row, P2: Row, z2: Row, variances: Pair, received: Pair
) -> tuple[Update, Update]:
    x4, P4, nis_4 = kalman.measure_pair_4(x4, P4, (z4[0], z4[1]), variances[0], received[0])
    x4, P4, nis_v4 = kalman.measure_velocities_4(x4, P4, (z4[2], z4[3]), variances[1], received[1])
    x2, P2, nis_2 = kalman.measure_first_2(x2, P2, z2[0], variances[0], received[0])
    x2, P2, nis_v2 = kalman.measure_second_2(x2, P2, z2[1], variances[1], received[1])
    return (x4, P4, nis_4 + nis_v4), (x2, P2, nis_2 + nis_v2)


@numba.njit
def measure_first(x_hat: Row, P: Row, z: float, variance: float, received: float) -> Update:
    return kalman.measure_first(x_hat, P, z, variance, received)


def split(vector: Array) -> tuple[Row, Row]:
    """The orbit plane's and the cross-track elements of a vector (6,)."""
    return tuple(vector[IN_PLANE]), tuple(vector[CROSS_TRACK])


def join(in_plane: Row, cross_track: Row) -> Array:
    vector = np.empty(6)
    vector[IN_PLANE], vector[CROSS_TRACK] = in_plane, cross_track
    return vector


def triangles(matrix: Array) -> tuple[Row, Row]:
    """Split a symmetric matrix (6, 6) without coupling into upper triangles."""
    blocks = (matrix[np.ix_(part, part)] for part in (IN_PLANE, CROSS_TRACK))
    in_plane, cross_track = (tuple(upper_triangle(block)) for block in blocks)
    return in_plane, cross_track


def symmetric(triangle: Row, size: int) -> Array:
    """The matrix (size, size) of an upper triangle."""
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = triangle
    return matrix + np.triu(matrix, 1).T


def join_triangles(in_plane: Row, cross_track: Row) -> Array:
    matrix = np.zeros((6, 6))
    matrix[np.ix_(IN_PLANE, IN_PLANE)] = symmetric(in_plane, 4)
    matrix[np.ix_(CROSS_TRACK, CROSS_TRACK)] = symmetric(cross_track, 2)
    return matrix


class LaneFilter:
    """The project's two lane filters as one of six states."""

    def __init__(self, x_hat: Array, P: Array, sigmas: Pair) -> None:
        self.x_hat, self.P, self.variances = x_hat, P, (sigmas[0] ** 2, sigmas[1] ** 2)

    def predict(self, Phi: Array, Q_noise: Array) -> None:
        Phi4, Phi2 = (tuple(Phi[np.ix_(part, part)].ravel()) for part in (IN_PLANE, CROSS_TRACK))
        (P4, P2), (Q4, Q2) = triangles(self.P), triangles(Q_noise)
        self.x_hat = Phi @ self.x_hat
        self.P = join_triangles(*time_update(P4, Phi4, Q4, P2, Phi2, Q2))

    def update(self, z: Array, received: Pair) -> float:
        """Take a measurement; return the normalised innovation squared."""
        (x4, x2), (P4, P2), (z4, z2) = split(self.x_hat), triangles(self.P), split(z)
        in_plane, cross_track = measurement_update(x4, P4, z4, x2, P2, z2, self.variances, received)
        self.x_hat = join(in_plane[0], cross_track[0])
        self.P = join_triangles(in_plane[1], cross_track[1])
        return float(in_plane[2] + cross_track[2])
