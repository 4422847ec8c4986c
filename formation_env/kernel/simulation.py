"""Rows of episodes of one scenario: the arrays that the compiled program works on, and named ways into them."""

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel import packing
from formation_env.kernel import tile as field
from formation_env.kernel.program import program
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES
from formation_env.numerics.random_streams import stream_key
from formation_env.task import observation
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import OFFSETS, WIDTH
from formation_env.task.variants import draw_variants

Rows = slice | NDArray[np.intp]
"""Some rows: a slice, or their indices."""


class Simulation:
    """Many independent episodes of one scenario, stepped together.

    Attributes:
        scenario: what is flown.
        num_rows: episodes side by side.
        variants: what is drawn from for each episode: the scenario alone, or its variants.
        schedule: the plans' tables (variants, steps, columns), see `schedule.FIELDS`; a shorter one repeats its end.
        actions: (num_rows, 3) float32, to be filled before `step`.
        results: (fields, rows and padding), of the last step or reset.
    """

    def __init__(self, scenario: Scenario, num_rows: int) -> None:
        tiles = -(-num_rows // LANES)
        self.scenario = scenario
        self.num_rows = num_rows
        self.variants = draw_variants(scenario)
        self.schedule, self._settings = packing.pack_variants(self.variants)
        self.actions = np.zeros((num_rows, 3), np.float32)
        self.results = np.zeros((field.NUM_RESULTS, tiles * LANES))
        self._states = np.zeros((tiles, field.STATE_FIELDS * LANES))
        self._scratch = np.zeros((field.TILE_FIELDS + self.schedule.shape[2] - WIDTH) * LANES)
        varied = len(self.variants) > 1
        self._program = (packing.truth_kind(scenario), packing.filter_kind(scenario), varied)
        self._width = (False,) * (1 if num_rows == 1 else LANES)
        self._nominal_starts = np.array([flown.start.formation.state(flown.orbit) for flown in self.variants])

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
            self.results,
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
            self.results,
            self._width,
        )

    def memory(self) -> Array:
        """All that the rows carry from step to step, random streams included: a copy, for `recall`."""
        return self._states.copy()

    def recall(self, memory: Array) -> None:
        """Put the rows back to where they were when `memory` gave this."""
        self._states[:] = memory

    def new_observations(self) -> NDArray[np.float32]:
        """An array for the observations of all rows."""
        return np.empty((self.num_rows, observation.SIZE), np.float32)

    def result(self, offset: int, rows: Rows = slice(None)) -> Array:
        """One result of the last step (rows,); a view if the rows are a slice."""
        return self.results[(offset - field.RESULTS) // LANES, : self.num_rows][rows]

    def result_vector(self, offset: int, size: int, rows: Rows = slice(None)) -> Array:
        """Copy (rows, size) of consecutive results of the last step."""
        first = (offset - field.RESULTS) // LANES
        return self.results[first : first + size, : self.num_rows].T[rows].copy()

    @property
    def first_references_m(self) -> Array:
        """The variants' reference positions at the start (variants, 3), m."""
        first = OFFSETS["scored_position"]
        return self.schedule[:, 0, first : first + 3]

    def variant(self, rows: Rows = slice(None)) -> NDArray[np.intp]:
        """Which of the variants rows flew in the last step, or begin (rows,)."""
        return self.result(field.VARIANT, rows).astype(np.intp)

    @property
    def flown(self) -> Scenario:
        """What the first row flies."""
        return self.variants[int(self.variant()[0])]

    def state(self, offset: int, size: int, rows: Rows = slice(None)) -> Array:
        """Copy (rows, size) of consecutive state fields."""
        if isinstance(rows, slice):
            block = self._states[:, offset : offset + size * LANES].reshape(-1, size, LANES)
            return block.transpose(0, 2, 1).copy().reshape(-1, size)[: self.num_rows][rows]
        columns = offset + np.arange(size) * LANES
        values: Array = self._states[(rows // LANES)[:, None], columns + (rows % LANES)[:, None]]
        return values

    def row_state(self, offset: int, size: int) -> Array:
        """Copy (size,) of consecutive state fields of the first row."""
        return self._states[0, offset : offset + size * LANES : LANES].copy()
