"""The settings of a scenario as the compiled step reads them: numbers in one line, named here.

A line is shared by all rows, or each row has its own (see `numerics.jit.numbers`); the functions below read it for row
i as tuples of scalars.
"""

from typing import Any, Final, NamedTuple

from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import inline_scalar, numbers


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
    process_noise: float
    sigma_pos: float
    sigma_vel: float
    spread_pos: float
    spread_vel: float
    filter_thrust_variance: float
    filter_variance_pos: float
    filter_variance_vel: float
    initial_variance_pos: float
    initial_variance_vel: float
    link_loss: float
    link_fail: float
    link_recover: float
    linear_cost: float
    quadratic_cost: float
    max_distance: float
    keep_out: float
    min_distance: float
    collision_distance: float
    max_error: float  # infinite if there is none
    tolerance: float


MODEL_SIZE: Final = 36
PROCESS_SIZE: Final = 13
FILTER_SIZE: Final = MODEL_SIZE + PROCESS_SIZE

# Places in the line: the true model, the filter's model and process noise, the forces, the scalars.
TRUTH: Final = 0
FILTER: Final = TRUTH + MODEL_SIZE
FORCES: Final = FILTER + FILTER_SIZE
SCALARS: Final = FORCES + len(Forces._fields)
SIZE: Final = SCALARS + len(Scalars._fields)

_NUM_FORCES: Final = len(Forces._fields)
_NUM_SCALARS: Final = len(Scalars._fields)


@inline_scalar
def scalars(settings: Array, i: int) -> Scalars:
    """The settings of one number each."""
    return Scalars(*numbers(settings, SCALARS, i, _NUM_SCALARS))


@inline_scalar
def forces(settings: Array, i: int) -> Forces:
    """The forces."""
    return Forces(*numbers(settings, FORCES, i, _NUM_FORCES))


@inline_scalar
def model(table: Array, first: int, i: int) -> Model:
    """The model whose numbers begin at `first` in any table."""
    return Model(
        numbers(table, first, i, 16),
        numbers(table, first + 16, i, 8),
        numbers(table, first + 24, i, 4),
        numbers(table, first + 28, i, 4),
        numbers(table, first + 32, i, 2),
        numbers(table, first + 34, i, 2),
    )


@inline_scalar
def process_noise(table: Array, first: int, i: int) -> ProcessNoise:
    """The process noise behind the filter's model, which begins at `first` in any table."""
    return ProcessNoise(numbers(table, first + MODEL_SIZE, i, 10), numbers(table, first + MODEL_SIZE + 10, i, 3))
