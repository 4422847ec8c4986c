"""Rows of episodes of one scenario: the arrays of the compiled program, and their values by name."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import packing
from formation_env.kernel import tile as field
from formation_env.kernel.program import program
from formation_env.kernel.stages.noise import NUM_NORMALS, PROCESS_NORMALS, SENSOR_NORMALS, THRUST_NORMAL
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES
from formation_env.numerics.random_streams import stream_key
from formation_env.task import observation
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import OFFSETS, WIDTH
from formation_env.task.variants import draw_variants

Rows = slice | NDArray[np.intp]
"""A selection of rows: a slice, or indices."""
ALL_ROWS: Final = slice(None)
RESULT_PLACES: Final = {name: first for name, (first, _) in field.STEP_RESULTS.items()}
"""Place of each named result, or of its first component, in `Simulation.first_row_results`."""
_STATE_SLICES: Final = {
    name: slice(first * LANES, (first + size) * LANES, LANES) for name, (first, size) in field.STATES.items()
}


class StepNoises(NamedTuple):
    """Random numbers of the last step (or reset), in physical units.

    Attributes:
        measurement: simulated measurement (rows, 6), m and m/s, whether or not it was received (`measured` tells); a
            sensor of positions alone gives (rows, 3).
        process_noise_m_s2: random acceleration along LVLH held over the step (rows, 3); 0 after a reset.
        thrust_noise: relative error of the thrust's magnitude (rows,); 0 after a reset.
    """

    measurement: Array
    process_noise_m_s2: Array
    thrust_noise: Array


class Simulation:
    """Independent episodes of one scenario, stepped together.

    Attributes:
        scenario: the scenario.
        num_rows: number of episodes side by side.
        variants: scenarios that each episode draws from: the scenario alone, or its variants.
        schedule: the plans' tables (variants, steps, columns), see `schedule.FIELDS`; a shorter one repeats its end.
        actions: (num_rows, 3) float32, to be filled before `step`.
    """

    def __init__(self, scenario: Scenario, num_rows: int) -> None:
        tiles = -(-num_rows // LANES)
        self.scenario = scenario
        self.num_rows = num_rows
        self.variants = draw_variants(scenario)
        self.schedule, self._settings = packing.pack_variants(self.variants)
        self.actions = np.zeros((num_rows, 3), np.float32)
        self._results = np.zeros((field.NUM_RESULTS, tiles * LANES))
        self._states = np.zeros((tiles, field.STATE_FIELDS * LANES))
        self._scratch = np.zeros((field.TILE_FIELDS + self.schedule.shape[2] - WIDTH) * LANES)
        varied = len(self.variants) > 1
        self._program = (packing.truth_kind(scenario), packing.filter_kind(scenario), varied)
        self._width = (False,) * (1 if num_rows == 1 else LANES)
        self._nominal_starts = np.array([each.start.formation.state(each.orbit) for each in self.variants])

    def seed(self, row: int, generator: np.random.Generator) -> None:
        """Give a row a new random stream; its next episode is the stream's first."""
        key = stream_key(generator).view(np.float64)
        for offset, value in ((field.KEY, key[0]), (field.KEY + LANES, key[1]), (field.EPISODE, -1.0)):
            self._states[row // LANES, offset + row % LANES] = value

    def reset(self, rows: NDArray[np.intp], observations: NDArray[np.float32], starts: Array | None = None) -> None:
        """Begin the next episode of some rows.

        Args:
            rows: their indices (k,).
            observations: (num_rows, SIZE), written in these rows.
            starts: LVLH states (k, 6) to start at, in place of the scenario's start and its spread.
        """
        places = self._nominal_starts if starts is None else np.ascontiguousarray(starts)
        program(*self._program).reset(
            self._states,
            self._scratch,
            self.schedule,
            self._settings,
            rows,
            places,
            starts is not None,
            observations,
            self._results,
            self._width,
        )

    def step(self, observations: NDArray[np.float32]) -> None:
        """Fly all rows over one step with `actions`.

        Args:
            observations: (num_rows, SIZE), written.
        """
        program(*self._program).step(
            self._states,
            self._scratch,
            self.schedule,
            self._settings,
            self.actions,
            observations,
            self._results,
            self._width,
        )

    def memory(self) -> Array:
        """Copy of the rows' state, random streams included, for `recall`."""
        return self._states.copy()

    def recall(self, memory: Array) -> None:
        """Restore the rows' state from a copy made by `memory`."""
        self._states[:] = memory

    def new_observations(self) -> NDArray[np.float32]:
        """Uninitialised array (num_rows, SIZE) for the observations of all rows."""
        return np.empty((self.num_rows, observation.SIZE), np.float32)

    def read(self, name: str, rows: Rows = ALL_ROWS, dtype: type = float) -> NDArray[Any]:
        """Copy of a named quantity of some rows.

        Args:
            name: a result of the last step or reset (`tile.STEP_RESULTS`: `position_error`, `thrust`, `measured`, ...)
                or a part of the state (`tile.STATES`: `true_state`, `estimate`, `measurement_age`, `sum_delta_v`, ...).
            rows: the rows, in this order.
            dtype: type of the values.

        Returns:
            (rows,), or (rows, size) for vectors and for triangles of covariances; SI units.

        Raises:
            KeyError: unknown name.
        """
        if name in field.STEP_RESULTS:
            first, size = field.STEP_RESULTS[name]
            if size == 1:
                scalars = self._results[first, : self.num_rows]
                return (scalars if rows is ALL_ROWS else scalars[rows]).astype(dtype)
            vectors = self._results[first : first + size, : self.num_rows].T
            return vectors[rows].astype(dtype, order="C")
        if name not in field.STATES:
            raise KeyError(f"read: unknown name {name!r}; known: {', '.join((*field.STEP_RESULTS, *field.STATES))}")
        values: NDArray[Any] = self._state(*field.STATES[name], rows).astype(dtype, copy=False)
        return values[:, 0] if values.shape[1] == 1 else values

    def totals(self, rows: Rows = ALL_ROWS) -> dict[str, Array]:
        """Totals of the rows' episodes up to now, by name (`tile.TOTALS`), each (rows,)."""
        block = self._state(field.FIRST_TOTAL // LANES, field.NUM_TOTALS, rows).T
        return {name: block[first] for name, (first, _) in field.TOTALS.items()}

    def first_row_results(self) -> list[float]:
        """Results of the first row's last step as Python numbers, by `RESULT_PLACES`; fast, for a single env."""
        values: list[float] = self._results[:, 0].tolist()
        return values

    def first_row_state(self, name: str) -> Array:
        """Copy (size,) of a named part of the first row's state; fast, for a single environment."""
        return self._states[0, _STATE_SLICES[name]].copy()

    def step_noises(self, rows: Rows = ALL_ROWS) -> StepNoises:
        """Random numbers of the last step, drawn again from the rows' streams: a step that nobody asks pays nothing."""
        normals = np.empty((NUM_NORMALS, self._results.shape[1]))
        program(*self._program).redraw(self._states, self._scratch, normals, self._width)
        drawn = normals[:, : self.num_rows].T[rows]
        own = self.variant(rows)
        flown = (self.read("step", rows) > 0)[:, None]
        sensor_sigma, process_sigma, thrust_sigma = (
            np.array(values)[own] for values in zip(*(_sigmas(each) for each in self.variants), strict=True)
        )
        measured = slice(3 if self.scenario.sensor.measures == "position" else 6)
        measurement = self.read("true_state", rows) + sensor_sigma * drawn[:, SENSOR_NORMALS]
        return StepNoises(
            measurement=measurement[:, measured],
            process_noise_m_s2=flown * process_sigma[:, None] * drawn[:, PROCESS_NORMALS],
            thrust_noise=flown[:, 0] * thrust_sigma * drawn[:, THRUST_NORMAL],
        )

    @property
    def first_references_m(self) -> Array:
        """The variants' reference positions at the start (variants, 3), m."""
        first = OFFSETS["scored_position"]
        return self.schedule[:, 0, first : first + 3]

    def variant(self, rows: Rows = ALL_ROWS) -> NDArray[np.intp]:
        """Index of the variant that each row flew in its last step, or begins (rows,)."""
        return self.read("variant", rows, np.intp)

    @property
    def first_row_scenario(self) -> Scenario:
        """The variant that the first row flies."""
        return self.variants[int(self.variant()[0])]

    def _state(self, first: int, size: int, rows: Rows) -> Array:
        """Copy (rows, size) of consecutive state fields."""
        offset = first * LANES
        if isinstance(rows, slice):
            block = self._states[:, offset : offset + size * LANES].reshape(-1, size, LANES)
            return block.transpose(0, 2, 1).copy().reshape(-1, size)[: self.num_rows][rows]
        columns = offset + np.arange(size) * LANES
        values: Array = self._states[(rows // LANES)[:, None], columns + (rows % LANES)[:, None]]
        return values


def _sigmas(scenario: Scenario) -> tuple[Array, float, float]:
    """Standard deviations of the sensor (6,), the process noise and the thrust's relative error."""
    sensor = np.repeat([scenario.sensor.sigma_pos_m, scenario.sensor.sigma_vel_m_s], 3)
    return sensor, scenario.process_noise_m_s2, scenario.spacecraft.thrust_noise
