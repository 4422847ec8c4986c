"""The stages of a step, each over one tile.

Each is a function of its own, since the compiler loses its grip on larger ones. The length of the tuple `lane_set` says
how many of the tile's rows are computed: it is part of a type, so known when compiling. A batch uses all LANES, and a
single environment one.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.dynamics.base import Array
from formation_env.jit import LANES, stage
from formation_env.kernel import filter, lanes, packing
from formation_env.kernel import tile as f
from formation_env.kernel.linear import read_model, read_process
from formation_env.kernel.tile import LaneSet
from formation_env.kernel.variants import column, own_scalars, own_sensor
from formation_env.observation import SIZE

STATE_SIZE: Final = f.STATE_FIELDS * LANES


@stage
def load(t: Array, lane_set: LaneSet, states: Array, tile: int, actions: NDArray[np.float32], used: int) -> None:
    """A tile's states and actions into scratch space, on the way to the next instant."""
    for k in range(STATE_SIZE):
        t[k] = states[tile, k]
    for i in range(used):
        for k in range(3):
            t[f.ACTION + k * LANES + i] = actions[tile * LANES + i, k]
    for i in range(len(lane_set)):
        t[f.STEP + i] += 1.0


@stage
def store(
    t: Array,
    lane_set: LaneSet,
    states: Array,
    tile: int,
    observations: NDArray[np.float32],
    results: Array,
    used: int,
) -> None:
    """A tile's states, observations and results out of scratch space."""
    first = tile * LANES
    for k in range(STATE_SIZE):
        states[tile, k] = t[k]
    for i in range(used):
        for k in range(SIZE):
            observations[first + i, k] = np.float32(t[f.OBSERVATION + k * LANES + i])
    for k in range(f.NUM_RESULTS):
        for i in range(len(lane_set)):
            results[k, first + i] = t[f.RESULTS + k * LANES + i]


@stage
def gather(t: Array, lane_set: LaneSet, states: Array, rows: NDArray[np.intp], first: int) -> None:
    """Rows from `first` on side by side into scratch space, on the way to the start of their next episode."""
    for i in range(len(lane_set)):
        source = min(first + i, len(rows) - 1)  # idle lanes repeat the last row
        tile, lane = rows[source] // LANES, rows[source] % LANES
        for k in range(f.STATE_FIELDS):
            t[k * LANES + i] = states[tile, k * LANES + lane]
        t[f.STEP + i] = 0.0
        t[f.EPISODE + i] += 1.0


@stage
def place(t: Array, lane_set: LaneSet, starts: Array, given: bool, first: int) -> None:
    """Where the rows start: each where it is told to, if that is given, else where its variant does."""
    for i in range(len(lane_set)):
        source = min(first + i, len(starts) - 1) if given else int(t[f.VARIANT + i])
        for k in range(6):
            t[f.TRUTH + k * LANES + i] = starts[source, k]


@stage
def scatter(
    t: Array,
    lane_set: LaneSet,
    states: Array,
    rows: NDArray[np.intp],
    first: int,
    observations: NDArray[np.float32],
    results: Array,
) -> None:
    """The way back of `gather`, with observations and results."""
    for i in range(min(len(lane_set), len(rows) - first)):
        row = rows[first + i]
        for k in range(f.STATE_FIELDS):
            states[row // LANES, k * LANES + row % LANES] = t[k * LANES + i]
        for k in range(SIZE):
            observations[row, k] = np.float32(t[f.OBSERVATION + k * LANES + i])
        for k in range(f.NUM_RESULTS):
            results[k, row] = t[f.RESULTS + k * LANES + i]


@stage
def draw(t: Array, lane_set: LaneSet, first_block: int) -> None:
    """Random numbers of an instant."""
    for block in range(3):
        for i in range(len(lane_set)):
            lanes.draw_uniforms(t, i, block, first_block)
    for pair in range(5):
        for i in range(len(lane_set)):
            lanes.draw_normals(t, i, pair)


@stage
def thrust(t: Array, lane_set: LaneSet, c: packing.Scalars | None) -> None:
    """Thruster and link."""
    for i in range(len(lane_set)):
        lanes.thruster(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        lanes.link(t, i, own_scalars(t, i, c))


@stage
def predict(t: Array, lane_set: LaneSet, model: packing.Model, noise: packing.ProcessNoise, c: packing.Scalars) -> None:
    """The filter's time update, by one model."""
    for i in range(len(lane_set)):
        filter.filter_time_update(t, i, model, noise, c)


@stage
def predict_varying(t: Array, lane_set: LaneSet, table: int, c: packing.Scalars | None) -> None:
    """The same by the row's own model, which the tile has at `table`."""
    for i in range(len(lane_set)):
        model, noise = read_model(t, i, table), read_process(t, i, table)
        filter.filter_time_update(t, i, model, noise, own_scalars(t, i, c))


@stage
def measure(t: Array, lane_set: LaneSet, sensor: packing.SensorNoise | None, c: packing.Scalars | None) -> None:
    """Measurement and the filter's measurement update."""
    for i in range(len(lane_set)):
        lanes.dropout(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        filter.filter_measurement_update(t, i, own_sensor(t, i, sensor), own_scalars(t, i, c))


@stage
def judge(t: Array, lane_set: LaneSet, c: packing.Scalars | None) -> None:
    """Reward, end and totals."""
    for i in range(len(lane_set)):
        lanes.reward_and_end(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        lanes.totals(t, i, own_scalars(t, i, c))


@stage
def observe(t: Array, lane_set: LaneSet, c: packing.Scalars | None) -> None:
    """The observation."""
    for axis in range(6):
        for i in range(len(lane_set)):
            lanes.observe_error(t, i, axis, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        lanes.observe_arrival(t, i, own_scalars(t, i, c))
    for i in range(len(lane_set)):
        lanes.observe_rest(t, i, own_scalars(t, i, c))


@stage
def begin(t: Array, lane_set: LaneSet, given: bool, c: packing.Scalars | None) -> None:
    """The start of an episode."""
    for i in range(len(lane_set)):
        lanes.begin(t, i, given, own_scalars(t, i, c))


@stage
def read_plan(t: Array, lane_set: LaneSet, used: int, schedule: Array, known_step: int) -> int:
    """The schedule's rows. Mostly all rows are at one step, which the scratch space may hold already.

    Args:
        t: the tile.
        lane_set: as long as the lanes computed.
        used: how many of them are rows; the others do not matter.
        schedule: the table (steps, columns).
        known_step: the step whose row the whole tile holds, or -1.

    Returns:
        The same, after this call.
    """
    last = len(schedule) - 1
    first = min(int(t[f.STEP]), last)
    same = True
    for i in range(1, used):
        same &= t[f.STEP + i] == t[f.STEP]
    if same and first == known_step:
        return first
    if same:
        for k in range(schedule.shape[1]):
            value = schedule[first, k]
            for i in range(len(lane_set)):
                t[column(k) + i] = value
        return first
    for i in range(len(lane_set)):
        step = min(int(t[f.STEP + i]), last)
        for k in range(schedule.shape[1]):
            t[column(k) + i] = schedule[step, k]
    return -1
