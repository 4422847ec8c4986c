"""The Kalman filter of the lanes at extreme ratios of prior, sensor and noise, against exact arithmetic."""

import dataclasses
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest
from env_helpers import covariances
from oracles import Array
from row_filter import BOTH, POSITION, LaneFilter, Pair

from formation_env import FormationVectorEnv, load_scenario
from formation_env.dropout import NoDropout
from formation_env.dynamics import HCW
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.navigation.filter_settings import process_noise_covariance
from formation_env.navigation.sensor import Sensor
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
MODEL = HCW().discretise(0.0, 30.0, ORBIT, Spacecraft(), Spacecraft())


@pytest.mark.parametrize("measures", ["position", "position_and_velocity"])
def test_a_perfect_sensor_is_followed_all_the_way(measures: str) -> None:
    """The environment's filter with a believed sigma of 0: the position is known to rounding after each measurement."""
    scenario = dataclasses.replace(
        load_scenario("keeping"),
        dropout=NoDropout(),
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0, measures=measures),
    )
    env = FormationVectorEnv(8, scenario)
    env.reset(seed=0)
    for _ in range(200):
        *_, info = env.step(env.action_space.sample())
        np.testing.assert_allclose(info["estimate"][:, :3], info["true_state"][:, :3], rtol=0, atol=1e-8)
        for P in covariances(env):
            assert (np.diag(P) >= 0).all()


class ExactFilter:
    """The textbook filter in decimal numbers of 90 digits."""

    def __init__(self, x_hat: Array, P: Array, sigmas: Pair) -> None:
        self.x_hat, self.P = decimals(x_hat), decimals(P)
        self.variances = decimals(np.repeat(sigmas, 3)) ** 2

    def predict(self, Phi: Array, Q_noise: Array) -> None:
        with localcontext(prec=90):
            self.x_hat = decimals(Phi).dot(self.x_hat)
            self.P = decimals(Phi).dot(self.P).dot(decimals(Phi).T) + decimals(Q_noise)

    def update(self, z: Array, received: Pair) -> None:
        with localcontext(prec=90):
            for i in np.flatnonzero(np.repeat(received, 3)):
                s = self.P[i, i] + self.variances[i]
                K = self.P[:, i] / s if s else decimals(np.arange(6) == i)
                self.x_hat = self.x_hat + K * (Decimal(z[i]) - self.x_hat[i])
                self.P = self.P - np.outer(K, self.P[i])


def decimals(values: Array) -> Any:
    return np.vectorize(Decimal, otypes=[object])(np.asarray(values, float))


def extreme_case(rng: np.random.Generator) -> tuple[Array, Pair, Array, float]:
    """Initial sigmas (6,), the sensor's sigmas (now and then 0), Phi and Gamma (6, 9) of a step, acceleration noise."""
    orbit = Orbit(altitude_m=10 ** rng.uniform(5.3, 7))
    model = HCW().discretise(0.0, 10 ** rng.uniform(0, 2.8), orbit, Spacecraft(), Spacecraft())
    sigmas = [10 ** rng.uniform(*exponents) * (rng.random() < 0.7) for exponents in ((-6, 3), (-8, 1))]
    initial = np.repeat([10 ** rng.uniform(-3, 6), 10 ** rng.uniform(-5, 6)], 3)
    return initial, (sigmas[0], sigmas[1]), np.hstack([model.Phi, model.Gamma]), 10 ** rng.uniform(-12, -2)


@pytest.mark.parametrize("received", [BOTH, POSITION], ids=["both", "position"])
@pytest.mark.parametrize("seed", range(30))
def test_extreme_ratios_against_exact_arithmetic(seed: int, received: Pair) -> None:
    """Prior over sensor up to 1e12 in sigma: the covariance stays possible, and no worse than 90 digits allow.

    Correlations: eigenvalues above -1e-7 (rounding over `LEAST_SHARE`). The estimate is within 8 of the filter's own
    sigmas of the truth, but for rounding. Its sigma is the exact one to 1 %, or larger, but for half of the digits of
    the largest sigma that one step brings.
    """
    rng = np.random.default_rng(seed)
    initial, sigmas, model, noise = extreme_case(rng)
    Phi, Gamma, Q_noise = model[:, :6], model[:, 6:], process_noise_covariance(model[:, 6:], noise)
    truth = initial * rng.normal(size=6)
    lanes, exact = (kind(np.zeros(6), np.diag(initial**2), sigmas) for kind in (LaneFilter, ExactFilter))
    for _ in range(12):
        truth = Phi @ truth + Gamma @ (noise * rng.normal(size=3))
        z = truth + np.repeat(sigmas, 3) * rng.normal(size=6)
        for filter_ in (lanes, exact):
            filter_.predict(Phi, Q_noise)
            filter_.update(z, received)
        sigma = np.sqrt(np.diag(lanes.P))
        scale = np.where(sigma > 0, sigma, 1.0)
        assert np.linalg.eigvalsh(lanes.P / np.outer(scale, scale)).min() > -1e-7
    assert (np.abs(lanes.x_hat - truth) < 8 * sigma + 1e-9 * np.abs(truth)).all()
    assert (sigma > 0.99 * np.sqrt(np.diag(exact.P).astype(float)) - 1e-9).all()


def test_position_of_a_millimetre_against_a_prior_of_100_km_per_second() -> None:
    """The variance was -2e5 and the estimate 38 km off; after three positions the velocity is that of differences."""
    rng = np.random.default_rng(0)
    truth = np.array([100.0, -200, 300, 1e4, -2e4, 3e4])
    lanes = LaneFilter(np.zeros(6), np.diag([1e4] * 3 + [1e10] * 3), (1e-3, 1e-3))
    for _ in range(5):
        lanes.update(truth + 1e-3 * rng.normal(size=6), POSITION)
        np.testing.assert_allclose(lanes.x_hat[:3], truth[:3], rtol=0, atol=1e-2)
        assert (np.diag(lanes.P) > 0).all()
        estimate = lanes.x_hat.copy()
        truth = MODEL.Phi @ truth
        lanes.predict(MODEL.Phi, np.zeros((6, 6)))
    np.testing.assert_allclose(MODEL.Phi @ estimate, truth, rtol=0, atol=1e-2)
