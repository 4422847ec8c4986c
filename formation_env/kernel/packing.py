"""A scenario's settings as one flat array of floats, which is all that the compiled step sees of it.

`pack` writes the named tuples below one after the other; `unpack` reads them back inside the compiled step, as scalars.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numba.np.unsafe import ndarray as numba_arrays

from formation_env.dynamics import DiscreteModel
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE, Array
from formation_env.estimation import process_noise_covariance, upper_triangle
from formation_env.jit import lane
from formation_env.scenario import Scenario
from formation_env.schedule import observation_layout


class Model(NamedTuple):
    """A discrete dynamics model, its matrices row by row: orbit plane (x, y, x', y') and cross-track axis (z, z')."""

    Phi_in_plane: Any  # 16
    Gamma_in_plane: Any  # 8
    delta_in_plane: Any  # 4
    Phi_cross_track: Any  # 4
    Gamma_cross_track: Any  # 2
    delta_cross_track: Any  # 2


class Noises(NamedTuple):
    """The noises that the filter believes in."""

    Q_in_plane: Any  # 10
    Q_cross_track: Any  # 3
    variances: Any  # 2: of a measured position and velocity axis
    thrust: Any  # 1: variance of the relative error of the thrust's magnitude
    measures: Any  # 2: 1 where the sensor measures positions, velocities


class Scalars(NamedTuple):
    """The settings of one number each."""

    dt_s: float
    num_steps: float
    max_accel: float
    min_accel: float
    thrust_noise: float
    process_noise: float
    sigma_pos: float
    sigma_vel: float
    spread_pos: float
    spread_vel: float
    initial_variance_pos: float
    initial_variance_vel: float
    link_loss: float
    link_fail: float
    link_recover: float
    linear_cost: float
    quadratic_cost: float
    max_distance: float
    keep_out: float
    tolerance: float
    per_length: float
    per_speed: float
    per_log_age: float
    per_phase: float


to_fixed_tuple: Any = numba_arrays.to_fixed_tuple

MODEL_SIZE: Final = 36
NOISES_SIZE: Final = 18
SCALAR_SIZE: Final = len(Scalars._fields)


def pack(scenario: Scenario) -> Array:
    """Settings (2 * MODEL_SIZE + NOISES_SIZE + SCALAR_SIZE,).

    Raises:
        ValueError: a dynamics model couples the orbit plane and the cross-track axis.
    """
    groups = (_model(scenario.true_model()), _model(scenario.filter_model()), _belief(scenario), _scalars(scenario))
    return np.concatenate([np.ravel(values) for group in groups for values in group])


@lane
def unpack(s: Array) -> tuple[Model, Model, Noises, Scalars]:
    """The settings as tuples of scalars, so that the compiler need not read memory to know them."""
    belief = Noises(
        to_fixed_tuple(s[72:82], 10),
        to_fixed_tuple(s[82:85], 3),
        to_fixed_tuple(s[85:87], 2),
        to_fixed_tuple(s[87:88], 1),
        to_fixed_tuple(s[88:90], 2),
    )
    scalars = Scalars(*to_fixed_tuple(s[90:], SCALAR_SIZE))
    return _unpack_model(s[:36]), _unpack_model(s[36:72]), belief, scalars


@lane
def _unpack_model(s: Array) -> Model:
    return Model(
        to_fixed_tuple(s[0:16], 16),
        to_fixed_tuple(s[16:24], 8),
        to_fixed_tuple(s[24:28], 4),
        to_fixed_tuple(s[28:32], 4),
        to_fixed_tuple(s[32:34], 2),
        to_fixed_tuple(s[34:36], 2),
    )


def _model(model: DiscreteModel) -> Model:
    coupling = [model.Phi[np.ix_(a, b)] for a, b in ((IN_PLANE, CROSS_TRACK), (CROSS_TRACK, IN_PLANE))]
    if any(np.any(block != 0) for block in coupling):
        raise ValueError("the dynamics model couples the orbit plane and the cross-track axis")
    return Model(
        Phi_in_plane=model.Phi[np.ix_(IN_PLANE, IN_PLANE)],
        Gamma_in_plane=model.Gamma[IN_PLANE, :2],
        delta_in_plane=model.delta[IN_PLANE],
        Phi_cross_track=model.Phi[np.ix_(CROSS_TRACK, CROSS_TRACK)],
        Gamma_cross_track=model.Gamma[CROSS_TRACK, 2],
        delta_cross_track=model.delta[CROSS_TRACK],
    )


def _belief(scenario: Scenario) -> Noises:
    believed = scenario.belief
    Q_noise = process_noise_covariance(scenario.filter_model().Gamma, believed.process_noise_m_s2)
    return Noises(
        Q_in_plane=upper_triangle(Q_noise[np.ix_(IN_PLANE, IN_PLANE)]),
        Q_cross_track=upper_triangle(Q_noise[np.ix_(CROSS_TRACK, CROSS_TRACK)]),
        variances=(believed.sigma_pos_m**2, believed.sigma_vel_m_s**2),
        thrust=(believed.thrust_noise**2,),
        measures=(1.0, float(scenario.sensor.measures == "position_and_velocity")),
    )


def _scalars(scenario: Scenario) -> Scalars:
    start, believed, reward = scenario.start, scenario.belief, scenario.reward
    chain = scenario.dropout.chain(scenario.dt_s, scenario.orbit)
    layout = observation_layout(scenario)
    return Scalars(
        dt_s=scenario.dt_s,
        num_steps=scenario.num_steps,
        max_accel=scenario.spacecraft.max_accel_m_s2,
        min_accel=scenario.spacecraft.min_accel_m_s2,
        thrust_noise=scenario.spacecraft.thrust_noise,
        process_noise=scenario.process_noise_m_s2,
        sigma_pos=scenario.sensor.sigma_pos_m,
        sigma_vel=scenario.sensor.sigma_vel_m_s,
        spread_pos=start.spread_pos_m,
        spread_vel=start.spread_vel_m_s,
        initial_variance_pos=believed.initial_sigma_pos_m**2,
        initial_variance_vel=believed.initial_sigma_vel_m_s**2,
        link_loss=chain.stationary_loss,
        link_fail=chain.fail,
        link_recover=chain.recover,
        linear_cost=1.0 if reward.shape == "linear" else 0.0,
        quadratic_cost=1 / reward.quadratic_scale_m if reward.shape == "quadratic" else 0.0,
        max_distance=scenario.limits.max_distance_m,
        keep_out=scenario.limits.keep_out_m,
        tolerance=scenario.tolerance_m,
        per_length=1 / layout.length_m,
        per_speed=1 / (layout.length_m * layout.mean_motion_rad_s),
        per_log_age=1 / np.log1p(layout.period_s / scenario.dt_s),
        per_phase=1 / layout.num_phases,
    )
