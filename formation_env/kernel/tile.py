"""The layout of a tile: LANES rows side by side, field after field, in one flat array.

A field is an offset; row i of the tile has its value at tile[FIELD + i]. Vectors and matrices take consecutive fields.
The first fields are a row's state and live from step to step; the rest is scratch space, shared by all tiles.
"""

from typing import Final

from formation_env.kernel import packing
from formation_env.numerics.jit import LANES
from formation_env.task import observation, schedule

Width = tuple[bool, ...]
"""Its length says how many rows of a tile are computed."""

_next_field = 0


def _field(size: int = 1) -> int:
    """Offset of a new field of `size` values per row."""
    global _next_field
    offset: int = _next_field * LANES
    _next_field += size
    return offset


# A row's state.
KEY: Final = _field(2)  # of the random stream, the bits of 64-bit integers
EPISODE: Final = _field()
STEP: Final = _field()
TRUTH: Final = _field(6)  # LVLH state, m and m/s
ESTIMATE: Final = _field(6)
P_IN_PLANE: Final = _field(10)  # filter's covariances, upper triangles
P_CROSS_TRACK: Final = _field(3)
LINK_UP: Final = _field()
AGE: Final = _field()  # s since the last measurement
# Totals of the episode.
FIRST_TOTAL: Final = _next_field * LANES
SUM_REWARD: Final = _field()
SUM_DELTA_V: Final = _field()
SUM_ERROR: Final = _field()  # over the hold
SUM_SQUARE: Final = _field()
MAX_ERROR: Final = _field()
ARRIVAL_ERROR: Final = _field()
TOLERATED: Final = _field()  # steps of the hold within the tolerance
LOST: Final = _field()  # steps without a measurement
NUM_TOTALS: Final = _next_field - FIRST_TOTAL // LANES
STATE_FIELDS: Final = _next_field

# Scratch: inputs of the step.
ACTION: Final = _field(3)
PLAN: Final = _field(schedule.WIDTH)  # the schedule's row
UNIFORM: Final = _field(12)
NORMAL: Final = _field(12)
COMMAND: Final = _field(3)  # acceleration that the filter knows of, m/s^2
# Results of the step, read by the environments.
RESULTS: Final = _next_field * LANES
THRUST: Final = _field(3)  # acceleration that acts, m/s^2
REWARD: Final = _field()
TERMINATED: Final = _field()
TRUNCATED: Final = _field()
POSITION_ERROR: Final = _field()
DELTA_V: Final = _field()
ERROR_COST: Final = _field()
EXIT_COST: Final = _field()
NIS: Final = _field()  # normalised innovation squared
MEASURED: Final = _field()
PHASE: Final = _field()
VARIANT: Final = _field()  # which of the scenario's variants is flown
NUM_RESULTS: Final = _next_field - RESULTS // LANES
OBSERVATION: Final = _field(observation.SIZE)
# For the true motion.
PUSH: Final = _field(3)  # thrust and random acceleration along LVLH, m/s^2
RELATIVE: Final = _field(6)  # position and velocity relative to the leader along inertial axes
BEFORE: Final = _field(6)  # the same at the substep's start
RATES: Final = _field(42)  # of each stage
SETTINGS: Final = _field(packing.SIZE)  # of the row's variant, if there are several
TABLE: Final = _next_field * LANES  # what else the plan's row has, see `packing.step_table`; as long as need be
TILE_FIELDS: Final = _next_field


def plan(name: str) -> int:
    """Offset of a column of the schedule."""
    return int(PLAN + schedule.OFFSETS[name] * LANES)


def seen(name: str) -> int:
    """Offset of a block of the observation."""
    return int(OBSERVATION + observation.SLICES[name].start * LANES)
