"""Steady state of the environments' Kalman filter without lost measurements, by python-control.

Legend: H measurement matrix, R_noise and Q_noise noise covariances, P covariance of the estimate's error.
"""

from dataclasses import dataclass

import control
import numpy as np

from baselines.design.riccati_solver import in_some_units
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
    """H (m, 6) of the sensor and R_noise (m, m) of the filter model."""
    H = np.eye(6) if scenario.sensor.measures == "position_and_velocity" else np.eye(3, 6)
    sigma = np.repeat([scenario.filter_model.sigma_pos_m, scenario.filter_model.sigma_vel_m_s], 3)[: len(H)]
    return H, np.diag(sigma**2)


def stationary_filter(scenario: Scenario) -> StationaryFilter:
    """The steady state of a scenario's filter without losses and thrust noise, by the filter's own model.

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
    push = filter_model.process_noise_m_s2 * model.Gamma

    def solve(factor: float) -> Array:
        unit = _units(scenario) * np.repeat([1.0, factor], 3)
        Phi, G, seen = model.Phi * unit / unit[:, None], push / unit[:, None], unit[: len(H)]
        Q_noise = G @ G.T
        _, P, _ = control.dlqe(Phi, np.eye(6), H, (Q_noise + Q_noise.T) / 2, R_noise / np.outer(seen, seen))
        return np.asarray(P * np.outer(unit, unit))

    predicted = in_some_units(solve, "filter: its noises and step give no stationary covariance that can be solved for")
    # K = P H' (H P H' + R)^-1
    gain = np.linalg.solve(H @ predicted @ H.T + R_noise, H @ predicted).T
    return StationaryFilter(np.asarray(gain), predicted, np.asarray((np.eye(6) - gain @ H) @ predicted))


def _units(scenario: Scenario) -> Array:
    """Units (6,) in which the filter's equation is of order one: in SI the solver fails at times.

    The time is the filter's own memory sqrt(sigma_pos / process noise) or the step, the length the sensor's error or
    what the noise pushes in a step.
    """
    model, dt_s = scenario.filter_model, scenario.dt_s
    time_s = max(np.sqrt(model.sigma_pos_m / model.process_noise_m_s2), dt_s)
    length_m = max(model.sigma_pos_m, model.process_noise_m_s2 * dt_s**2)
    return np.repeat([length_m, length_m / time_s], 3)
