"""The Kalman filter of the lanes, against filterpy's textbook filter."""

import numba
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as Textbook
from oracles import Array, random_covariance
from scipy.integrate import quad_vec
from scipy.linalg import expm

from formation_env.dynamics import HCW
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.kernel import kalman
from formation_env.navigation.filter_settings import process_noise_covariance, upper_triangle
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
MODEL = HCW().discretise(0.0, 30.0, ORBIT, Spacecraft(), Spacecraft())
Row = tuple[float, ...]
Pair = tuple[float, float]
Update = tuple[Row, Row, float]

BOTH, POSITION, NOTHING = (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)
MEASURED = {BOTH: slice(0, 6), POSITION: slice(0, 3)}


@numba.njit
def time_update(P4: Row, Phi4: Row, Q4: Row, P2: Row, Phi2: Row, Q2: Row) -> tuple[Row, Row]:
    return kalman.time_update_4(P4, Phi4, Q4), kalman.time_update_2(P2, Phi2, Q2)


@numba.njit
def measurement_update(
    x4: Row, P4: Row, z4: Row, x2: Row, P2: Row, z2: Row, variances: Pair, received: Pair
) -> tuple[Update, Update]:
    return (
        kalman.measurement_update_4(x4, P4, z4, variances, received),
        kalman.measurement_update_2(x2, P2, z2, variances, received),
    )


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
    """The same of a symmetric matrix (6, 6) without coupling, as upper triangles."""
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


def uncoupled_covariance(rng: np.random.Generator) -> Array:
    """A random covariance (6, 6), in m and cm/s, without coupling of orbit plane and cross-track."""
    root = join_triangles(upper_triangle(random_covariance(rng, 4)), upper_triangle(random_covariance(rng, 2)))
    scale = np.array([1, 1, 1, 1e-2, 1e-2, 1e-2])
    return root @ root.T * np.outer(scale, scale)


def pair(rng: np.random.Generator) -> tuple[LaneFilter, Textbook]:
    """The lane filter and filterpy's with one random start."""
    x_hat, P = rng.normal(size=6), uncoupled_covariance(rng)
    textbook = Textbook(dim_x=6, dim_z=6)
    textbook.x, textbook.P, textbook.F = x_hat.copy(), P.copy(), MODEL.Phi
    textbook.Q = process_noise_covariance(MODEL.Gamma, 1e-3)
    return LaneFilter(x_hat, P, (2.0, 0.02)), textbook


def update_textbook(textbook: Textbook, z: Array, received: Pair) -> float:
    """The same measurement for filterpy; its normalised innovation squared."""
    if received == NOTHING:
        textbook.update(None)
        return 0.0
    rows = MEASURED[received]
    R_noise = np.diag([4.0] * 3 + [4e-4] * 3)[rows, rows]
    textbook.update(z[rows], R=R_noise, H=np.eye(6)[rows])
    return float(textbook.y @ textbook.SI @ textbook.y)


@pytest.mark.parametrize(
    "pattern",
    [[BOTH], [POSITION], [NOTHING], [BOTH, POSITION, NOTHING, NOTHING]],
    ids=["both", "position", "nothing", "mixed"],
)
def test_filter_is_the_textbook_one(pattern: list[Pair]) -> None:
    """40 predictions and updates: estimate, covariance and NIS of filterpy's 6-state filter.

    One measurement after the other is exactly all at once, as their errors are independent; rounding only: 1e-9 leaves
    room for filterpy's matrix inverse.
    """
    rng = np.random.default_rng(7)
    lanes, textbook = pair(rng)
    for step in range(40):
        z, received = rng.normal(size=6) * ([2.0] * 3 + [0.02] * 3), pattern[step % len(pattern)]
        textbook.predict()
        lanes.predict(textbook.F, textbook.Q)
        assert lanes.update(z, received) == pytest.approx(update_textbook(textbook, z, received), rel=1e-9)
        np.testing.assert_allclose(lanes.x_hat, textbook.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(lanes.P, textbook.P, rtol=1e-9, atol=1e-12)


def test_one_measurement_is_the_textbook_update() -> None:
    """`measure_first` with a full covariance (4, 4) against K = P h / s, (I - K h') P; rounding only."""
    rng = np.random.default_rng(3)
    P, x_hat = random_covariance(rng, 4), rng.normal(size=4)
    new_x, triangle, nis = measure_first(tuple(x_hat), tuple(upper_triangle(P)), 0.7, 0.3, 1.0)
    K = P[:, 0] / (P[0, 0] + 0.3)
    np.testing.assert_allclose(new_x, x_hat + K * (0.7 - x_hat[0]), rtol=1e-13)
    np.testing.assert_allclose(symmetric(triangle, 4), P - np.outer(K, P[0]), rtol=1e-12)
    assert nis == pytest.approx((0.7 - x_hat[0]) ** 2 / (P[0, 0] + 0.3), rel=1e-13)


def test_a_lost_measurement_changes_nothing() -> None:
    """Not a bit of estimate and covariance, whatever stands in the measurement's place."""
    lanes, _ = pair(np.random.default_rng(4))
    x_hat, P = lanes.x_hat.copy(), lanes.P.copy()
    assert lanes.update(np.full(6, 1e9), NOTHING) == 0
    np.testing.assert_array_equal(lanes.x_hat, x_hat)
    np.testing.assert_array_equal(lanes.P, P)


def test_a_sensor_without_noise_is_believed() -> None:
    """With R_noise = 0 the estimate is the measurement and its covariance zero, but for rounding of size P eps."""
    lanes, _ = pair(np.random.default_rng(5))
    lanes.variances = (0.0, 0.0)
    z = np.array([1.0, -2.0, 3.0, 0.01, -0.02, 0.03])
    lanes.update(z, BOTH)
    np.testing.assert_allclose(lanes.x_hat, z, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(lanes.P, 0, atol=1e-12)


def test_a_known_state_measured_without_noise_stays() -> None:
    """P = R_noise = 0 has no gain and no innovation variance: nothing divides by zero."""
    lanes = LaneFilter(np.arange(6.0), np.zeros((6, 6)), (0.0, 0.0))
    assert lanes.update(np.ones(6), BOTH) == 0
    np.testing.assert_array_equal(lanes.x_hat, np.arange(6.0))
    np.testing.assert_array_equal(lanes.P, np.zeros((6, 6)))


@pytest.mark.parametrize("received", [BOTH, POSITION])
def test_covariance_stays_positive_at_extreme_ratios(received: Pair) -> None:
    """P of 1e8 against R_noise of 1e-8, by Joseph's form: variances and their correlations stay possible."""
    scale = np.array([1e4] * 3 + [1e1] * 3)
    lanes = LaneFilter(np.zeros(6), np.diag(scale**2), (1e-4, 1e-7))
    for _ in range(50):
        lanes.predict(MODEL.Phi, process_noise_covariance(MODEL.Gamma, 1e-6))
        lanes.update(np.zeros(6), received)
        sigma = np.sqrt(np.diag(lanes.P))
        assert (sigma > 0).all()
        correlation = lanes.P / np.outer(sigma, sigma)
        assert np.linalg.eigvalsh(correlation).min() > 0


def test_upper_triangle_is_row_by_row() -> None:
    """The order of `Symmetric4`'s elements."""
    matrix = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9.0]])
    np.testing.assert_array_equal(upper_triangle(matrix), np.arange(10))
    np.testing.assert_array_equal(symmetric(tuple(np.arange(10.0)), 4), matrix)


def test_process_noise_is_that_of_accelerations_held_over_a_step() -> None:
    """Q_noise = E[w w'], w = integral of exp(A (T - t)) B a dt: the integral by quadrature, to 1e-10 of itself."""
    A, B = HCW().state_matrix(ORBIT, Spacecraft()), np.eye(6)[:, 3:]
    effect, _ = quad_vec(lambda t: expm(A * (30.0 - t)) @ B, 0, 30.0)
    expected = 1e-3**2 * effect @ effect.T
    np.testing.assert_allclose(process_noise_covariance(MODEL.Gamma, 1e-3), expected, rtol=1e-10, atol=1e-18)
