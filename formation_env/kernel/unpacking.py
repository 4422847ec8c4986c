"""The packed settings of a scenario, as the compiled step reads them: named tuples of scalars, one after the other."""

from typing import Any, Final, NamedTuple

from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import inline_scalar, spaced


class Model(NamedTuple):
    """A discrete dynamics model, its matrices row by row: orbit plane (x, y, x', y') and cross-track axis (z, z')."""

    Phi_in_plane: Any  # 16
    Gamma_in_plane: Any  # 8
    delta_in_plane: Any  # 4
    Phi_cross_track: Any  # 4
    Gamma_cross_track: Any  # 2
    delta_cross_track: Any  # 2


class ProcessNoise(NamedTuple):
    """Process noise of the filter's model: upper triangles of its covariances over a step."""

    Q_in_plane: Any  # 10
    Q_cross_track: Any  # 3


class SensorNoise(NamedTuple):
    """Sensor of the filter's model."""

    variances: Any  # 2: of a measured position and velocity axis
    measures: Any  # 2: 1 where the sensor measures positions, velocities


class Forces(NamedTuple):
    """Forces of the nonlinear truth."""

    substeps: float
    j2: float
    density: float  # kg/m^3, at the base radius
    base_radius: float
    per_scale_height: float
    drag_area: float  # per mass, m^2/kg
    sun: float  # 1 if it pulls
    moon: float
    radiation_area: float  # per mass, m^2/kg


class Scalars(NamedTuple):
    """The settings of one number each."""

    dt_s: float
    num_steps: float
    max_accel: float
    min_accel: float
    thrust_noise: float
    filter_thrust_variance: float
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


MODEL_SIZE: Final = 36


PROCESS_SIZE: Final = 13


FILTER_SIZE: Final = MODEL_SIZE + PROCESS_SIZE


SENSOR_SIZE: Final = 4


FORCES_SIZE: Final = len(Forces._fields)


SCALAR_SIZE: Final = len(Scalars._fields)


FILTER: Final = MODEL_SIZE


SENSOR: Final = FILTER + FILTER_SIZE


FORCES: Final = SENSOR + SENSOR_SIZE


SCALARS: Final = FORCES + FORCES_SIZE


SIZE: Final = SCALARS + SCALAR_SIZE


@inline_scalar
def unpack(s: Array) -> tuple[Model, Model, ProcessNoise, SensorNoise, Forces, Scalars]:
    """The settings as tuples of scalars, so that the compiler need not read memory to know them."""
    truth, filter_model, process = unpack_model(s, 0, 1), unpack_model(s, FILTER, 1), unpack_process(s, FILTER, 1)
    return truth, filter_model, process, unpack_sensor(s, 0, 1), unpack_forces(s, 0, 1), unpack_scalars(s, 0, 1)


@inline_scalar
def unpack_model(s: Array, first: int, step: int) -> Model:
    """A model from its MODEL_SIZE numbers.

    Args:
        s: where they are, among others.
        first: place of the first.
        step: from one to the next.
    """
    return Model(
        spaced(s, first, step, 16),
        spaced(s, first + 16 * step, step, 8),
        spaced(s, first + 24 * step, step, 4),
        spaced(s, first + 28 * step, step, 4),
        spaced(s, first + 32 * step, step, 2),
        spaced(s, first + 34 * step, step, 2),
    )


@inline_scalar
def unpack_process(s: Array, first: int, step: int) -> ProcessNoise:
    """The process noise behind the filter's model, which is at `first`."""
    first += MODEL_SIZE * step
    return ProcessNoise(spaced(s, first, step, 10), spaced(s, first + 10 * step, step, 3))


@inline_scalar
def unpack_sensor(s: Array, first: int, step: int) -> SensorNoise:
    """The sensor out of all settings, which begin at `first`."""
    first += SENSOR * step
    return SensorNoise(spaced(s, first, step, 2), spaced(s, first + 2 * step, step, 2))


@inline_scalar
def unpack_forces(s: Array, first: int, step: int) -> Forces:
    """The forces out of all settings, which begin at `first`."""
    return Forces(*spaced(s, first + FORCES * step, step, FORCES_SIZE))


@inline_scalar
def unpack_scalars(s: Array, first: int, step: int) -> Scalars:
    """The settings of one number each out of all settings, which begin at `first`."""
    return Scalars(*spaced(s, first + SCALARS * step, step, SCALAR_SIZE))
