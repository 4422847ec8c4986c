"""Settings of the Kalman filter, and the covariance of its process noise."""

from dataclasses import dataclass

import numpy as np

from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Acceleration, Distance, Speed, ThrustNoise
from formation_env.settings import Text, settings


@settings
class KalmanFilter:
    """Settings of the filter's model; each value left out equals the truth's.

    Attributes:
        dynamics: name of the linear dynamics model.
        sigma_pos_m: 1-sigma of the measured position, m.
        sigma_vel_m_s: 1-sigma of the measured velocity, m/s.
        process_noise_m_s2: 1-sigma of the random acceleration of each axis, held over a step, m/s^2.
        thrust_noise: 1-sigma of the relative error of the thrust's magnitude.
        orbit: the leader's orbit.
        spacecraft: the follower's drag (and the leader's, if the scenario has no other).
        initial_sigma_pos_m: 1-sigma of the first estimate's position, m.
        initial_sigma_vel_m_s: 1-sigma of the first estimate's velocity, m/s.
    """

    dynamics: Text | None = None
    sigma_pos_m: Distance | None = None
    sigma_vel_m_s: Speed | None = None
    process_noise_m_s2: Acceleration | None = None
    thrust_noise: ThrustNoise | None = None
    orbit: Orbit | None = None
    spacecraft: Spacecraft | None = None
    initial_sigma_pos_m: Distance | None = None
    initial_sigma_vel_m_s: Speed | None = None


@dataclass(frozen=True)
class FilterModel:
    """The filter's model in full: `KalmanFilter` with the truth's value wherever it leaves one out."""

    dynamics: str
    sigma_pos_m: float
    sigma_vel_m_s: float
    process_noise_m_s2: float
    thrust_noise: float
    orbit: Orbit
    spacecraft: Spacecraft
    initial_sigma_pos_m: float
    initial_sigma_vel_m_s: float


def process_noise_covariance(Gamma: Array, sigma_m_s2: float) -> Array:
    """Q_noise (..., 6, 6) = Gamma Gamma' sigma^2 of white accelerations held over each step.

    Args:
        Gamma: input matrix (..., 6, 3) of the step.
        sigma_m_s2: 1-sigma of each axis, m/s^2.
    """
    Q_noise: Array = sigma_m_s2**2 * Gamma @ np.swapaxes(Gamma, -1, -2)
    return Q_noise


def upper_triangle(matrix: Array) -> Array:
    """The upper triangle of symmetric matrices (..., m, m), row by row: (..., m (m + 1) / 2)."""
    rows, columns = np.triu_indices(matrix.shape[-1])
    return matrix[..., rows, columns]
