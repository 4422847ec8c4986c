"""The Kalman filter of the lanes, against filterpy's textbook filter."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as Textbook
from oracles import Array, random_covariance
from row_filter import (
    BOTH,
    NOTHING,
    POSITION,
    LaneFilter,
    Pair,
    join_triangles,
    measure_first,
    symmetric,
)
from scipy.integrate import quad_vec
from scipy.linalg import expm

from formation_env.dynamics import HCW
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.navigation.filter_settings import process_noise_covariance, upper_triangle
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
MODEL = HCW().discretise(0.0, 30.0, ORBIT, Spacecraft(), Spacecraft())
MEASURED = {BOTH: slice(0, 6), POSITION: slice(0, 3)}


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


def test_a_perfect_sensor_overrules_an_estimate_that_counts_as_certain() -> None:
    """P = R_noise = 0: eq. (4.71) has 0 / 0; the measurement is taken, and the covariance stays 0 but for rounding."""
    lanes = LaneFilter(np.arange(6.0), np.zeros((6, 6)), (0.0, 0.0))
    assert np.isfinite(lanes.update(np.ones(6), BOTH))
    np.testing.assert_array_equal(lanes.x_hat, np.ones(6))
    np.testing.assert_allclose(lanes.P, 0, atol=1e-19)


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
