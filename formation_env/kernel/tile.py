"""The layout of a tile: LANES rows side by side, field after field, in one flat array.

A field is an offset; row i of the tile has its value at tile[FIELD + i]. Vectors and matrices take consecutive fields.
The first fields are a row's state and live from step to step; the rest is scratch space, shared by all tiles. A field
with a name can be read from outside, by `Simulation.read`.
"""

from typing import Final, NamedTuple

from formation_env.kernel import unpacking
from formation_env.numerics.jit import LANES
from formation_env.task import observation, schedule

Width = tuple[bool, ...]
"""Number of rows of a tile that are computed, as the length of a tuple: numba specialises on it."""


class Span(NamedTuple):
    """The values per row that belong to a name.

    Attributes:
        first: index of the first value among all fields (an offset is LANES times as large).
        size: number of values.
    """

    first: int
    size: int


_next_field = 0
_spans: dict[str, Span] = {}


def _field(name: str = "", size: int = 1) -> int:
    """Offset of a new field of `size` values per row; with a name it can be read from outside."""
    global _next_field
    offset: int = _next_field * LANES
    if name:
        _spans[name] = Span(_next_field, size)
    _next_field += size
    return offset


def _named(first: int, end: int) -> dict[str, Span]:
    """Spans of the named fields from `first` to `end`, counted from `first`."""
    return {name: Span(at - first, size) for name, (at, size) in _spans.items() if first <= at < end}


# A row's state.
KEY: Final = _field(size=2)  # of the random stream, the bits of 64-bit integers
EPISODE: Final = _field("episode")
STEP: Final = _field("step")
TRUTH: Final = _field("true_state", 6)  # LVLH state, m and m/s
ESTIMATE: Final = _field("estimate", 6)
P_IN_PLANE: Final = _field("covariance_in_plane", 10)  # filter's covariances, upper triangles
P_CROSS_TRACK: Final = _field("covariance_cross_track", 3)
LINK_UP: Final = _field("link_up")
AGE: Final = _field("measurement_age")  # s since the last measurement
# Totals of the episode.
FIRST_TOTAL: Final = _next_field * LANES
SUM_REWARD: Final = _field("sum_reward")
SUM_DELTA_V: Final = _field("sum_delta_v")
SUM_ERROR: Final = _field("sum_error")  # over the hold
SUM_SQUARE: Final = _field("sum_square_error")
MAX_ERROR: Final = _field("max_error")
ARRIVAL_ERROR: Final = _field("arrival_error")
TOLERATED: Final = _field("tolerated")  # steps of the hold within the tolerance
LOST: Final = _field("lost")  # steps without a measurement
NUM_TOTALS: Final = _next_field - FIRST_TOTAL // LANES
STATE_FIELDS: Final = _next_field
STATES: Final = _named(0, STATE_FIELDS)
"""Named parts of a row's state."""
TOTALS: Final = _named(FIRST_TOTAL // LANES, STATE_FIELDS)
"""Totals of the episode, counted from the first."""

# Scratch: inputs of the step.
ACTION: Final = _field(size=3)
PLAN: Final = _field(size=schedule.WIDTH)  # the schedule's row
UNIFORM: Final = _field(size=12)
NORMAL: Final = _field(size=12)
COMMAND: Final = _field(size=3)  # acceleration that the filter knows of, m/s^2
# Results of the step.
RESULTS: Final = _next_field * LANES
THRUST: Final = _field("thrust", 3)  # acceleration that acts, m/s^2
REWARD: Final = _field("reward")
TERMINATED: Final = _field("terminated")
TRUNCATED: Final = _field("truncated")
POSITION_ERROR: Final = _field("position_error")
DELTA_V: Final = _field("delta_v")
ERROR_COST: Final = _field("error_cost")
EXIT_COST: Final = _field("exit_cost")
NIS: Final = _field("nis")  # normalised innovation squared
MEASURED: Final = _field("measured")
PHASE: Final = _field("phase")
VARIANT: Final = _field("variant")  # index of the scenario's variant that the row flies
NUM_RESULTS: Final = _next_field - RESULTS // LANES
STEP_RESULTS: Final = _named(RESULTS // LANES, _next_field)
"""Named results of a step, counted from the first."""
OBSERVATION: Final = _field(size=observation.SIZE)
# For the true motion.
PUSH: Final = _field(size=3)  # thrust plus random acceleration along LVLH, m/s^2
RELATIVE: Final = _field(size=6)  # position and velocity relative to the leader along inertial axes
BEFORE: Final = _field(size=6)  # RELATIVE at the substep's start
RATES: Final = _field(size=42)  # of each stage
SETTINGS: Final = _field(size=unpacking.SIZE)  # of the row's variant, if there are several
TABLE: Final = _next_field * LANES  # the row's varying models, last since their number varies (`packing.step_table`)
TILE_FIELDS: Final = _next_field


def plan(name: str) -> int:
    """Offset of a column of the schedule."""
    return int(PLAN + schedule.OFFSETS[name] * LANES)


def seen(name: str) -> int:
    """Offset of a block of the observation."""
    return int(OBSERVATION + observation.SLICES[name].start * LANES)
