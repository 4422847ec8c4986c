"""Rows of episodes of one scenario: the arrays of the compiled program, and their values by name."""

from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.packing import pack_variants
from formation_env.kernel.program import is_guarded, kinds_of, look, program
from formation_env.kernel.results import RESULT_NAMES, StepResults, block_shapes
from formation_env.kernel.reused_arrays import ReusedArrays, ReusedZeros
from formation_env.kernel.stages.noise import STREAM_SIZE
from formation_env.kernel.threads import run_parts
from formation_env.kernel.tile import STATE, STATE_SIZE, TOTALS, State
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES
from formation_env.numerics.random_streams import stream_key
from formation_env.task import observation
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import OFFSETS
from formation_env.task.variants import draw_variants

Rows = slice | NDArray[np.intp]
"""A selection of rows: a slice, or indices."""
ALL_ROWS: Final = slice(None)
_STATE_SPANS: Final = {name: (getattr(STATE, name) // LANES, size) for name, size in State()._asdict().items()}
_STATE_SLICES: Final = {
    name: slice(first * LANES, (first + size) * LANES, LANES) for name, (first, size) in _STATE_SPANS.items()
}


class Simulation:
    """Independent episodes of one scenario, stepped together.

    Attributes:
        scenario: the scenario.
        num_rows: number of episodes side by side.
        variants: scenarios that each episode draws from: the scenario alone, or its variants.
        schedule: the plans' tables (variants, steps, columns), see `schedule.FIELDS`; a shorter one repeats its end.
        plan_limits: steps of each variant's plan and its distance limit, m (variants, 2).
        actions: (num_rows, 3) float32, to be filled before `step`.
        guarded: whether costs are computed.
        safety_totals: sum of costs and least distance (m) of the rows' episodes up to now (2, num_rows), if guarded.
        results: of the last step or reset; `step` makes new ones, and does not change those that came before.
    """

    def __init__(
        self,
        scenario: Scenario,
        num_rows: int,
        with_noises: bool = False,
        num_threads: int = 1,
        variants: tuple[Scenario, ...] | None = None,
        guarded: bool = False,
    ) -> None:
        """Make the rows; they have no streams before `seed`.

        Args:
            scenario: the scenario.
            num_rows: rows.
            with_noises: whether results hold the step's noises, see `tile.Noises`.
            num_threads: threads that share a step; results are the same bits for any number.
            variants: what the rows may fly, if not what `draw_variants` gives.
            guarded: whether costs are computed even if the scenario limits nothing.
        """
        tiles = -(-num_rows // LANES)
        self.scenario = scenario
        self.num_rows = num_rows
        self.variants = variants or draw_variants(scenario)
        self.schedule, self._seen, self._settings = pack_variants(self.variants)
        self.actions = np.zeros((num_rows, 3), np.float32)
        self.guarded = guarded or is_guarded(scenario)
        self._shapes = shapes = block_shapes(num_rows, self.guarded, with_noises)
        self._blocks, self._last_blocks = ReusedArrays(shapes), ReusedZeros(shapes)
        self._observations = ReusedArrays([((num_rows, observation.SIZE), np.float32)])
        self.results = StepResults.zeros(num_rows, shapes)
        self.safety_totals = np.zeros((2, num_rows if self.guarded else 0))
        self._states = np.zeros((tiles, STATE_SIZE))
        self._streams = np.zeros((tiles, STREAM_SIZE), np.uint32)
        self._keys = np.zeros((num_rows, 3), np.uint64)
        self._arrays = (self._states, self._streams, self.schedule, self._seen, self._settings)
        num_parts = min(num_threads, tiles)
        self._parts = list(pairwise(tiles * part // num_parts for part in range(num_parts + 1)))
        self._kinds = kinds_of(self.variants[0], len(self.variants))
        self.plan_limits = np.array([(each.num_steps, each.limits.max_distance_m) for each in self.variants])
        self._nominal_starts = np.array([each.start.formation.state(each.orbit) for each in self.variants])

    def seed(self, row: int, generator: np.random.Generator) -> None:
        """Give a row a new random stream; its next episode is the stream's first."""
        self._keys[row, :2] = stream_key(generator)
        self._keys[row, 2] = 0

    def reset(self, rows: NDArray[np.intp], observations: Array32, starts: Array | None = None) -> None:
        """Begin the next episode of some rows; `results` change in these rows, but for reward and ends.

        Args:
            rows: their indices (k,).
            observations: (num_rows, SIZE), written in these rows.
            starts: LVLH states (k, 6) to start at, in place of the scenario's start and its spread.
        """
        program(self._kinds).reset(
            self._states,
            self._streams,
            self._keys,
            self.schedule,
            self._seen,
            self._settings,
            rows,
            self._nominal_starts if starts is None else np.ascontiguousarray(starts, float),
            starts is not None,
            observations,
            *self.results.blocks,
        )
        self._begin_safety(rows)

    def _begin_safety(self, rows: NDArray[np.intp]) -> None:
        """Begin the totals of safety of some rows."""
        if self.guarded:
            self.safety_totals[0, rows] = 0.0
            self.safety_totals[1, rows] = self.results["least_distance"][rows]

    def count_safety(self) -> None:
        """Add the last step to the totals of safety; `step` does so itself, `fly` does not."""
        if self.guarded:
            costs, least = map(self._flown, self.safety_totals)
            costs += self._flown(self.results["cost"])
            np.minimum(least, self._flown(self.results["least_distance"]), out=least)

    def _flown(self, values: NDArray[Any]) -> NDArray[Any]:  # a view of the values of all rows that fly
        return values

    def step(self, observations: Array32) -> int:
        """Fly all rows over one step with `actions`, and put new `results`.

        Args:
            observations: (num_rows, SIZE), written.

        Returns:
            How many episodes ended.
        """
        del self.results  # so that its blocks are written again if nobody else holds them
        self.results = StepResults(self._blocks.take(), self.num_rows)
        parts = [self.arguments(observations, first, last) for first, last in self._parts]
        ended = run_parts(lambda part: self.fly(parts[part]), len(parts))
        self.count_safety()
        return ended

    def arguments(self, observations: Array32, first: int = 0, last: int | None = None) -> tuple[Any, ...]:
        """Arguments of `fly` for the tiles from first to last - 1: where it writes observations, and results as now."""
        last = len(self._states) if last is None else last
        return (*self._arrays, first, last, self.actions, observations, *self.results.blocks)

    def fly(self, arguments: tuple[Any, ...]) -> int:
        """Fly some tiles over one step in this thread; returns how many episodes ended."""
        ended: int = program(self._kinds).step(*arguments)
        return ended

    def forget_ends(self, rows: NDArray[np.intp]) -> None:
        """Let rows that only began in this step have neither reward nor end."""
        self.results["reward"][rows] = 0.0
        self.results["terminated"][rows] = self.results["truncated"][rows] = False

    def new_results(self, rows: NDArray[np.intp]) -> None:
        """Let a reset of some rows write into blocks of its own."""
        if len(rows) < self.num_rows:
            self.results = self.results.copy()
        else:
            self.results = StepResults.zeros(self.num_rows, self._shapes)

    def last_results(self, rows: NDArray[np.intp]) -> StepResults:
        """The results of some rows as they are now, zero elsewhere; no later step or reset changes them."""
        return self.results.only(rows, self._last_blocks.take_for(rows))

    def memory(self) -> Array:
        """Copy of the rows' state, random streams included, for `recall`: numbers (k,) of any meaning."""
        return np.concatenate([part.ravel() for part in self._remembered()])

    def recall(self, memory: Array) -> None:
        """Restore the rows' state from a copy made by `memory`."""
        parts = self._remembered()
        ends = np.cumsum([part.size for part in parts])
        for part, values in zip(parts, np.split(memory, ends[:-1]), strict=True):
            part[...] = values.reshape(part.shape)

    def _remembered(self) -> list[Array]:
        """Views of all that a step changes, as float64."""
        return [part.view(np.float64) for part in (self._states, self._streams, self._keys, self.safety_totals)]

    def look(self, observations: Array32) -> None:
        """Write the observations (num_rows, SIZE) of all rows again, as the last step or reset left them."""
        look()(self._states, self.schedule, self._seen, observations)

    def new_observations(self) -> NDArray[np.float32]:
        """Uninitialised array (num_rows, SIZE) for the observations of all rows."""
        return self._observations.take()[0]

    def read(self, name: str, rows: Rows = ALL_ROWS, dtype: type = float) -> NDArray[Any]:
        """Copy of a named quantity of some rows.

        Args:
            name: a result of the last step or reset (`tile.Results`, `Flags`, `Integers`: `position_error`, `thrust`,
                `measured`, ...) or a part of the state (`tile.State`: `estimate`, `sum_delta_v`, ...).
            rows: the rows, in this order.
            dtype: type of the values.

        Returns:
            (rows,), or (rows, size) for vectors and for triangles of covariances; SI units.

        Raises:
            KeyError: unknown name.
        """
        if name in STATE._fields:
            values: NDArray[Any] = self._state(*_STATE_SPANS[name], rows).astype(dtype, copy=False)
            return values[:, 0] if values.shape[1] == 1 else values
        if name not in RESULT_NAMES:
            raise KeyError(f"read: unknown name {name!r}; known: {', '.join((*RESULT_NAMES, *STATE._fields))}")
        return self.results[name][rows].astype(dtype, order="C")

    def totals(self, rows: Rows = ALL_ROWS) -> dict[str, Array]:
        """Totals of the rows' episodes up to now, by name (`tile.TOTALS`), each (rows,)."""
        first, _ = _STATE_SPANS[TOTALS[0]]
        return dict(zip(TOTALS, self._state(first, len(TOTALS), rows).T, strict=True))

    def first_row_state(self, name: str) -> Array:
        """Copy (size,) of a named part of the first row's state; fast, for a single environment."""
        return self._states[0, _STATE_SLICES[name]].copy()

    @property
    def first_references_m(self) -> Array:
        """The variants' reference positions at the start (variants, 3), m."""
        return self.schedule[:, 0, OFFSETS["scored_position"] :][:, :3]

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
        columns = offset + np.arange(size) * LANES + (rows % LANES)[:, None]
        return np.asarray(self._states[(rows // LANES)[:, None], columns])
