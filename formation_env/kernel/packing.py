"""A scenario as the compiled step sees it: a line of `kernel.settings`, and tables of what differs by step."""

from functools import lru_cache
from typing import Final

import numpy as np

from formation_env.dynamics import NONLINEAR, DiscreteModel
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE
from formation_env.dynamics.nonlinear import leader_table, substeps
from formation_env.kernel.settings import (
    FILTER,
    FORCES,
    SCALARS,
    SIZE,
    TRUTH,
    Forces,
    Model,
    ProcessNoise,
    Scalars,
)
from formation_env.navigation.filter_settings import process_noise_covariance, upper_triangle
from formation_env.numerics.arrays import Array, Array32
from formation_env.task.observation import BOUND, observation_layout
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import SCALES, build_schedule, column, columns

CONSTANT: Final = "constant"
VARYING: Final = "varying"


def truth_kind(scenario: Scenario) -> str:
    """Kind of the true motion: linear, `constant` or `varying`; or nonlinear, by `near` or also by `far` forces."""
    if scenario.dynamics == NONLINEAR:
        return "far" if scenario.perturbations.far_bodies else "near"
    return _linear_kind(scenario.true_dynamics())


def filter_kind(scenario: Scenario) -> str:
    """Whether the filter's model is `constant` or `varying`."""
    return _linear_kind(scenario.filter_dynamics())


def _linear_kind(model: DiscreteModel) -> str:
    return VARYING if model.Phi.ndim == 3 else CONSTANT


@lru_cache(maxsize=2)
def pack_variants(scenarios: tuple[Scenario, ...]) -> tuple[Array, Array32, Array]:
    """What the compiled step reads of scenarios.

    The arrays are shared by all who ask for them; nobody writes into them.

    Returns:
        Tables (variants, steps, columns), each as long as the longest by repeating its end; what the observation shows
        of them (variants, steps, NUM_SEEN), see `seen_table`; settings (variants, SIZE).
    """
    tables = [step_table(scenario) for scenario in scenarios]
    seen = [seen_table(scenario, table) for scenario, table in zip(scenarios, tables, strict=True)]
    return _stacked(tables), _stacked(seen).astype(np.float32), np.stack([pack(scenario) for scenario in scenarios])


def _stacked(tables: list[Array]) -> Array:
    longest = max(len(table) for table in tables)
    return np.stack([np.pad(table, ((0, longest - len(table)), (0, 0)), mode="edge") for table in tables])


def seen_table(scenario: Scenario, plan: Array) -> Array:
    """The elements of the observation that depend on the plan alone, from `reference` to `time_left`; `SCALES` behind.

    Args:
        scenario: the scenario.
        plan: its table (num_steps + 1, columns).
    """
    layout = observation_layout(scenario)
    shown = [
        columns(plan, "reference") / layout.state_scale,
        *(column(plan, name)[:, None] for name in ("time_to_arrival", "in_hold")),
        column(plan, "phase")[:, None] / layout.num_phases,
        column(plan, "time_left")[:, None],
    ]
    scales = {
        "per_length": 1 / layout.length_m,
        "per_speed": 1 / (layout.length_m * layout.mean_motion_rad_s),
        "per_step": 1 / scenario.dt_s,
        "per_log_age": 1 / np.log1p(layout.period_s / scenario.dt_s),
    }
    constant = np.broadcast_to([scales[name] for name in SCALES], (len(plan), len(SCALES)))
    return np.hstack([np.clip(np.hstack(shown), -BOUND, BOUND), constant])


def pack(scenario: Scenario) -> Array:
    """Settings (SIZE,). Models that vary are left 0 here; `step_table` has them.

    Raises:
        ValueError: a dynamics model couples the orbit plane and the cross-track axis.
    """
    settings = np.zeros(SIZE)
    if truth_kind(scenario) == CONSTANT:
        settings[TRUTH:FILTER] = _model(scenario.true_dynamics())
    if filter_kind(scenario) == CONSTANT:
        settings[FILTER:FORCES] = _filter(scenario)
    settings[FORCES:SCALARS] = _forces(scenario)
    settings[SCALARS:] = _scalars(scenario)
    return settings


def step_table(scenario: Scenario) -> Array:
    """The plan with what varies behind it, (num_steps + 1, columns); row k has what acts on the step to instant k.

    The columns are those of `schedule`; then the filter's `Model` and `ProcessNoise`, if they vary; then the true
    `Model`, if that varies, or the leader's path, if the truth is nonlinear.
    """
    columns = []
    if filter_kind(scenario) == VARYING:
        columns.append(_filter(scenario))
    if truth_kind(scenario) == VARYING:
        columns.append(_model(scenario.true_dynamics()))
    elif truth_kind(scenario) != CONSTANT:
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
    return Scalars(
        dt_s=scenario.dt_s,
        num_steps=scenario.num_steps,
        max_accel=scenario.spacecraft.max_accel_m_s2,
        min_accel=scenario.spacecraft.min_accel_m_s2,
        thrust_noise=scenario.spacecraft.thrust_noise,
        process_noise=scenario.process_noise_m_s2,
        sigma_pos=scenario.sensor.sigma_pos_m,
        sigma_vel=scenario.sensor.sigma_vel_m_s,
        spread_pos=start.initial_sigma_pos_m,
        spread_vel=start.initial_sigma_vel_m_s,
        filter_thrust_variance=believed.thrust_noise**2,
        filter_variance_pos=believed.sigma_pos_m**2,
        filter_variance_vel=believed.sigma_vel_m_s**2,
        initial_variance_pos=believed.initial_sigma_pos_m**2,
        initial_variance_vel=believed.initial_sigma_vel_m_s**2,
        link_loss=chain.stationary_loss,
        link_fail=chain.fail,
        link_recover=chain.recover,
        linear_cost=cost.linear,
        quadratic_cost=cost.quadratic,
        max_distance=scenario.limits.max_distance_m,
        keep_out=scenario.limits.keep_out_m,
        min_distance=scenario.safety.min_distance_m,
        collision_distance=scenario.safety.collision_distance_m,
        max_error=scenario.safety.max_error_m or np.inf,
        tolerance=scenario.tolerance_m,
    )
