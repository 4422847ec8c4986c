"""The layout of a tile: LANES rows side by side, field after field, in flat arrays.

A field is an offset: row i has its value at array[FIELD + i], and the next component of a vector LANES further on. The
classes below declare the fields in order, each with its number of values; `STATE`, `WORK`, ... hold the offsets.
"""

from typing import Final, NamedTuple, TypeVar

import numpy as np

from formation_env.numerics.jit import LANES
from formation_env.task import observation, schedule


class State(NamedTuple):
    """What a row carries from step to step, float64."""

    true_state: int = 6  # LVLH, m and m/s
    estimate: int = 6
    covariance_in_plane: int = 10  # the filter's, upper triangles
    covariance_cross_track: int = 3
    link_up: int = 1
    measured: int = 1  # 1 if this instant's measurement arrived
    measurement_age: int = 1  # s since the last measurement
    step: int = 1
    variant: int = 1  # index of the scenario's variant that the row flies
    # Totals of the episode.
    sum_reward: int = 1
    sum_delta_v: int = 1
    sum_error: int = 1  # over the hold
    sum_square_error: int = 1
    max_error: int = 1
    arrival_error: int = 1
    tolerated: int = 1  # steps of the hold within the tolerance
    lost: int = 1  # steps without a measurement


class Work(NamedTuple):
    """Scratch space of a step, float64, shared by all tiles."""

    command: int = 3  # acceleration that the filter knows of, m/s^2
    push: int = 3  # acceleration that acts, with the random one, m/s^2
    measurement: int = 6  # simulated, m and m/s, whether or not it is received
    innovation: int = 6  # measurement minus its prediction
    # The step's results, in the order of `Results`.
    thrust: int = 3
    position_error: int = 1
    delta_v: int = 1
    error_cost: int = 1
    exit_cost: int = 1
    nis: int = 1
    reward: int = 1
    terminated: int = 1
    truncated: int = 1
    # For the nonlinear truth.
    relative: int = 6  # position and velocity relative to the leader along inertial axes
    before: int = 6  # the same at the substep's start
    rates: int = 42  # of each stage
    # For what is checked along the step's arc.
    start_state: int = 6  # the true state before the step
    leader_distance: int = 1  # least distance from the leader, m
    # The results of `Safety`, in its order.
    cost: int = 1
    least_distance: int = 1
    plan: int = schedule.WIDTH  # the row's line of the schedule; behind it stand its varying models


class Work32(NamedTuple):
    """Scratch space of a step, float32, shared by all tiles."""

    process_noise: int = 3  # standard normals
    sensor_noise: int = 6
    thrust_noise: int = 1
    link_noise: int = 1  # uniform in [0, 1)
    observation: int = observation.SIZE
    scales: int = len(schedule.SCALES)  # of the observation, see `schedule.SCALES`


class Results(NamedTuple):
    """What a step or a reset tells, float64; its own block (fields, rows), which the step writes once."""

    true_state: int = 6
    estimate: int = 6
    thrust: int = 3  # acceleration that acts, m/s^2
    position_error: int = 1
    delta_v: int = 1
    error_cost: int = 1
    exit_cost: int = 1
    nis: int = 1  # normalised innovation squared
    reward: int = 1


class Flags(NamedTuple):
    """What a step or a reset tells, yes or no, in a block (fields, rows)."""

    measured: int = 1
    terminated: int = 1
    truncated: int = 1


class Integers(NamedTuple):
    """What a step or a reset tells in whole numbers, in a block (fields, rows)."""

    phase: int = 1
    variant: int = 1


class Safety(NamedTuple):
    """What a step tells of a scenario that limits anything, float64 (fields, rows)."""

    cost: int = 1  # 1 if the step violated what `scenario.Safety` asks for, else 0
    least_distance: int = 1  # from any other spacecraft along the step's arc, m


class Noises(NamedTuple):
    """Random numbers of a step in physical units and what the filter made of them, for those who ask (fields, rows)."""

    measurement: int = 6  # simulated, m and m/s, whether or not it is received
    innovation: int = 6  # measurement minus its prediction
    process_noise: int = 3  # random acceleration along LVLH, m/s^2
    thrust_noise: int = 1  # relative error of the thrust's magnitude


Fields = TypeVar("Fields", State, Work, Work32, Results, Flags, Integers, Safety, Noises)


def _placed(sizes: Fields, unit: int) -> Fields:
    """The offset of each field: `unit` for each value before it."""
    return type(sizes)(*(int(end - size) * unit for size, end in zip(sizes, np.cumsum(sizes), strict=True)))


STATE: Final = _placed(State(), LANES)
WORK: Final = _placed(Work(), LANES)
WORK32: Final = _placed(Work32(), LANES)
RESULTS: Final = _placed(Results(), 1)
FLAGS: Final = _placed(Flags(), 1)
INTEGERS: Final = _placed(Integers(), 1)
SAFETY: Final = _placed(Safety(), 1)
NOISES: Final = _placed(Noises(), 1)

STATE_SIZE: Final = sum(State()) * LANES
WORK_SIZE: Final = sum(Work()) * LANES
WORK32_SIZE: Final = sum(Work32()) * LANES
NUM_RESULTS: Final = sum(Results())
SHOWN: Final = RESULTS.reward
"""How many of the results infos show; the reward behind them is returned by itself."""
NUM_SAFETY: Final = sum(Safety())
NUM_NOISES: Final = sum(Noises())
TOTALS: Final = State._fields[State._fields.index("step") :]
"""Names of the totals of the episode and what goes with them, the last fields of a row's state."""
MODELS: Final = WORK_SIZE // LANES
"""Place of the first number of the row's varying models, counted in numbers."""


def plan(name: str) -> int:
    """Offset of a column of the schedule in `Work`."""
    return int(WORK.plan + schedule.OFFSETS[name] * LANES)


def seen(name: str) -> int:
    """Offset of a block of the observation in `Work32`."""
    return int(WORK32.observation + observation.SLICES[name].start * LANES)
