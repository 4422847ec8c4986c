"""The Kalman filter that the environments' one becomes when no measurement is lost: gains by python-control.

Legend: H measurement matrix, R_noise and Q_noise noise covariances, P covariance of the estimate's error.
"""

from dataclasses import dataclass

import control
import numpy as np

from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario


@dataclass(frozen=True)
class StationaryFilter:
    """x_hat(k) = x_hat^-(k) + gain (z(k) - H x_hat^-(k)), the limit of Ma 2009, eq. (4.69-4.75).

    Attributes:
        gain: (6, m) for m measurements.
        predicted: covariance (6, 6) just before a measurement.
        updated: covariance (6, 6) just after it.
    """

    gain: Array
    predicted: Array
    updated: Array


def measurement(scenario: Scenario) -> tuple[Array, Array]:
    """H (m, 6) of the sensor and R_noise (m, m) as the filter believes it."""
    H = np.eye(6) if scenario.sensor.measures == "position_and_velocity" else np.eye(3, 6)
    sigma = np.repeat([scenario.filter_model.sigma_pos_m, scenario.filter_model.sigma_vel_m_s], 3)[: len(H)]
    return H, np.diag(sigma**2)


def stationary_filter(scenario: Scenario) -> StationaryFilter:
    """What a scenario's filter settles at without losses and thrust noise, by its own beliefs.

    With the gains of `riccati.stationary` it makes the LQG controller of constant gains.

    Raises:
        ValueError: there is no noise, in the process or in the sensor, or the model varies; then nothing settles, or
            at zero.
    """
    filter_model, model = scenario.filter_model, scenario.filter_dynamics()
    if model.Phi.ndim == 3:
        raise ValueError(f"filter.dynamics: must be a model that does not vary, got {filter_model.dynamics}")
    H, R_noise = measurement(scenario)
    for key, value in (("process_noise_m_s2", filter_model.process_noise_m_s2), ("sigma", R_noise.diagonal().min())):
        if value <= 0:
            raise ValueError(f"{key}: must be > 0 for a stationary filter, got {value:g}")
    # python-control's gain is that of the predictor, Phi K
    L, predicted, _ = control.dlqe(model.Phi, model.Gamma, H, filter_model.process_noise_m_s2**2 * np.eye(3), R_noise)
    gain = np.linalg.solve(model.Phi, np.asarray(L))
    return StationaryFilter(gain, np.asarray(predicted), (np.eye(6) - gain @ H) @ predicted)
