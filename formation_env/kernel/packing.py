"""A scenario as the compiled step sees it: one flat array of settings, and a table with what differs from step to step.

`pack` writes the named tuples below one after the other; `unpack` reads them back inside the compiled step, as scalars.
"""

from functools import lru_cache
from typing import Final

import numpy as np

from formation_env.dynamics import NONLINEAR, DiscreteModel
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE
from formation_env.dynamics.nonlinear import leader_table, substeps
from formation_env.kernel.unpacking import (
    FILTER,
    FORCES,
    SCALARS,
    SENSOR,
    SIZE,
    Forces,
    Model,
    ProcessNoise,
    Scalars,
    SensorNoise,
)
from formation_env.navigation.filter_settings import process_noise_covariance, upper_triangle
from formation_env.numerics.arrays import Array
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule

# What the true motion is made of, and the filter's: compile-time constants.
TIME_INVARIANT: Final = 0
TIME_VARYING: Final = 1
NONLINEAR_NEAR: Final = 2  # gravity and drag
NONLINEAR_FAR: Final = 3  # Sun, Moon and radiation pressure, too


def truth_kind(scenario: Scenario) -> int:
    """Kind of the true motion."""
    if scenario.dynamics == NONLINEAR:
        return NONLINEAR_FAR if scenario.perturbations.far_bodies else NONLINEAR_NEAR
    return _linear_kind(scenario.true_dynamics())


def filter_kind(scenario: Scenario) -> int:
    """Whether the filter's model is the same at all steps."""
    return _linear_kind(scenario.filter_dynamics())


def _linear_kind(model: DiscreteModel) -> int:
    return TIME_VARYING if model.Phi.ndim == 3 else TIME_INVARIANT


@lru_cache(maxsize=2)
def pack_variants(scenarios: tuple[Scenario, ...]) -> tuple[Array, Array]:
    """Tables (variants, steps, columns), each as long as the longest by repeating its end; settings (variants, SIZE).

    The arrays are shared by all who ask for them; nobody writes into them.
    """
    tables = [step_table(scenario) for scenario in scenarios]
    longest = max(len(table) for table in tables)
    plans = np.stack([np.pad(table, ((0, longest - len(table)), (0, 0)), mode="edge") for table in tables])
    return plans, np.stack([pack(scenario) for scenario in scenarios])


def pack(scenario: Scenario) -> Array:
    """Settings (SIZE,). Models that vary are left 0 here; `step_table` has them.

    Raises:
        ValueError: a dynamics model couples the orbit plane and the cross-track axis.
    """
    settings = np.zeros(SIZE)
    if truth_kind(scenario) == TIME_INVARIANT:
        settings[:FILTER] = _model(scenario.true_dynamics())
    if filter_kind(scenario) == TIME_INVARIANT:
        settings[FILTER:SENSOR] = _filter(scenario)
    settings[SENSOR:FORCES] = np.ravel(_sensor(scenario))
    settings[FORCES:SCALARS] = _forces(scenario)
    settings[SCALARS:] = _scalars(scenario)
    return settings


def step_table(scenario: Scenario) -> Array:
    """The plan with what varies behind it, (num_steps + 1, columns); row k has what acts on the step to instant k.

    The columns are those of `schedule`; then the filter's `Model` and `ProcessNoise`, if they vary; then the true
    `Model`, if that varies, or the leader's path, if the truth is nonlinear.
    """
    columns = []
    if filter_kind(scenario) == TIME_VARYING:
        columns.append(_filter(scenario))
    if truth_kind(scenario) == TIME_VARYING:
        columns.append(_model(scenario.true_dynamics()))
    elif truth_kind(scenario) != TIME_INVARIANT:
        columns.append(leader_table(scenario.world, scenario.leader, scenario.dt_s, scenario.num_steps))
    plan = build_schedule(scenario)
    return np.hstack([plan, *(np.vstack([part[:1], part]) for part in columns)])


def _block(matrices: Array, rows: Array, columns: Array) -> Array:
    """Rows and columns of matrices (..., 6, m), as numbers (..., count)."""
    block = matrices[..., rows[:, None], columns]
    return block.reshape(*block.shape[:-2], -1)


def _model(model: DiscreteModel) -> Array:
    """Numbers (..., MODEL_SIZE) of a discrete model."""
    coupling = [_block(model.Phi, a, b) for a, b in ((IN_PLANE, CROSS_TRACK), (CROSS_TRACK, IN_PLANE))]
    if any(np.any(block != 0) for block in coupling):
        raise ValueError("the dynamics model couples the orbit plane and the cross-track axis")
    parts = Model(
        Phi_in_plane=_block(model.Phi, IN_PLANE, IN_PLANE),
        Gamma_in_plane=_block(model.Gamma, IN_PLANE, np.array([0, 1])),
        delta_in_plane=model.delta[..., IN_PLANE],
        Phi_cross_track=_block(model.Phi, CROSS_TRACK, CROSS_TRACK),
        Gamma_cross_track=_block(model.Gamma, CROSS_TRACK, np.array([2])),
        delta_cross_track=model.delta[..., CROSS_TRACK],
    )
    return np.concatenate(parts, axis=-1)


def _filter(scenario: Scenario) -> Array:
    """Numbers (..., FILTER_SIZE) of the filter's model and process noise."""
    model = scenario.filter_dynamics()
    Q_noise = process_noise_covariance(model.Gamma, scenario.filter_model.process_noise_m_s2)
    noise = ProcessNoise(
        Q_in_plane=upper_triangle(Q_noise[..., IN_PLANE[:, None], IN_PLANE]),
        Q_cross_track=upper_triangle(Q_noise[..., CROSS_TRACK[:, None], CROSS_TRACK]),
    )
    return np.concatenate([_model(model), *noise], axis=-1)


def _sensor(scenario: Scenario) -> SensorNoise:
    believed = scenario.filter_model
    return SensorNoise(
        variances=(believed.sigma_pos_m**2, believed.sigma_vel_m_s**2),
        measures=(1.0, float(scenario.sensor.measures == "position_and_velocity")),
    )


def _forces(scenario: Scenario) -> Forces:
    on, craft = scenario.perturbations, scenario.spacecraft
    return Forces(
        substeps=substeps(scenario.dt_s),
        j2=scenario.orbit.j2_coefficient,
        density=craft.air_density_kg_m3,
        base_radius=scenario.orbit.semi_major_axis_m,
        per_scale_height=1 / on.scale_height_m if on.scale_height_m else 0.0,
        drag_area=craft.drag_area_per_mass_m2_kg * on.drag,
        sun=float(on.sun),
        moon=float(on.moon),
        radiation_area=craft.radiation_area_per_mass_m2_kg * on.radiation_pressure,
    )


def _scalars(scenario: Scenario) -> Scalars:
    start, believed, cost = scenario.start, scenario.filter_model, scenario.reward.cost()
    chain = scenario.dropout.chain(scenario.dt_s, scenario.orbit)
    layout = observation_layout(scenario)
    return Scalars(
        dt_s=scenario.dt_s,
        num_steps=scenario.num_steps,
        max_accel=scenario.spacecraft.max_accel_m_s2,
        min_accel=scenario.spacecraft.min_accel_m_s2,
        thrust_noise=scenario.spacecraft.thrust_noise,
        filter_thrust_variance=believed.thrust_noise**2,
        process_noise=scenario.process_noise_m_s2,
        sigma_pos=scenario.sensor.sigma_pos_m,
        sigma_vel=scenario.sensor.sigma_vel_m_s,
        spread_pos=start.initial_sigma_pos_m,
        spread_vel=start.initial_sigma_vel_m_s,
        initial_variance_pos=believed.initial_sigma_pos_m**2,
        initial_variance_vel=believed.initial_sigma_vel_m_s**2,
        link_loss=chain.stationary_loss,
        link_fail=chain.fail,
        link_recover=chain.recover,
        linear_cost=cost.linear,
        quadratic_cost=cost.quadratic,
        max_distance=scenario.limits.max_distance_m,
        keep_out=scenario.limits.keep_out_m,
        tolerance=scenario.tolerance_m,
        per_length=1 / layout.length_m,
        per_speed=1 / (layout.length_m * layout.mean_motion_rad_s),
        per_log_age=1 / np.log1p(layout.period_s / scenario.dt_s),
        per_phase=1 / layout.num_phases,
    )
