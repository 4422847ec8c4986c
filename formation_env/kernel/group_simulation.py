"""Groups of followers of one scenario: the arrays of the compiled program for groups, and their values by name."""

from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.group_program import Rules, group_kinds, group_program
from formation_env.kernel.group_scratch import scratch_sizes
from formation_env.kernel.reused_arrays import ReusedArrays
from formation_env.kernel.simulation import Simulation
from formation_env.kernel.stages.inter_satellite_link import PAIR_SIZE, LinkSettings
from formation_env.kernel.stages.messages import block_size
from formation_env.kernel.stages.noise import STREAM_SIZE
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES
from formation_env.task.members import members
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario

Groups = NDArray[np.intp]


class GroupSimulation(Simulation):
    """Independent groups of followers, stepped together; each follower is a row.

    Rows are padded: follower f of group g is row f * padded + g, where `padded` is the number of groups up to a whole
    number of tiles. `by_group` takes values of all rows apart.

    Attributes:
        num_groups: groups.
        count: followers of a group.
        padded: see above.
        gone: 1 where a follower's episode has ended before its group's (count, padded).
        slots: who flies where in each group (num_groups, count).
    """

    def __init__(self, scenario: Scenario, num_groups: int, with_noises: bool = False, num_threads: int = 1) -> None:
        """Make the groups; they have no streams before `seed_group`. The arguments are those of `Simulation`."""
        self.count, self.num_groups = scenario.followers, num_groups
        blocks = -(-num_groups // LANES)
        self.padded = blocks * LANES
        variants = tuple(chain.from_iterable(members(scenario)))
        super().__init__(scenario, self.count * self.padded, with_noises, variants=variants, guarded=True)
        pairs, layout = self.count * (self.count - 1) // 2, observation_layout(scenario)
        self._observations = ReusedArrays([((num_groups * self.count, layout.size), np.float32)])
        self._links = np.zeros((blocks, pairs * PAIR_SIZE * LANES))
        self._sent = np.zeros((blocks, block_size(self.count)))
        self._link_streams = np.zeros((blocks, STREAM_SIZE), np.uint32)
        self.gone = np.zeros((self.count, self.padded))
        self.slots = np.full((num_groups, self.count), -1, np.int64)
        self._rules, self._closed = rules(scenario)
        gone = self.gone.reshape(-1, LANES)
        self._of_groups = (self._links, self._sent, self._link_streams, gone, self._rules, self._closed)
        num_parts = min(num_threads, blocks)
        self._parts = list(pairwise(blocks * part // num_parts for part in range(num_parts + 1)))
        self._scratch = [scratch(self.schedule.shape[2], self.count) for _ in self._parts]
        self._kinds = group_kinds(scenario)

    def seed_group(self, group: int, generator: np.random.Generator) -> None:
        """Give the followers of a group new random streams; its next episode is their first."""
        for row in self.rows_of(np.array([group])).ravel().tolist():
            self.seed(row, generator)

    def rows_of(self, groups: Groups) -> NDArray[np.intp]:
        """Rows (count, k) of the followers of some groups (k,)."""
        return np.arange(self.count)[:, None] * self.padded + groups

    def _flown(self, values: NDArray[Any]) -> NDArray[Any]:
        return self.by_group(values)

    def by_group(self, values: NDArray[Any]) -> NDArray[Any]:
        """A view (num_groups, count, ...) of values of all rows (rows, ...)."""
        return values.reshape(self.count, self.padded, *values.shape[1:])[:, : self.num_groups].swapaxes(0, 1)

    def rewards(self) -> Array:
        """Mean reward of the followers of each group in the last step (num_groups,)."""
        by_follower = self._flown(self.results["reward"]).T
        total: Array = by_follower[0].copy()
        for rewards in by_follower[1:]:  # in this order for any number of groups
            total += rewards
        return total / self.count

    def set_actions(self, actions: NDArray[np.floating]) -> None:
        """Take the actions (num_groups, count, 3) of the next step."""
        self.by_group(self.actions)[:] = actions

    def reset_groups(
        self, groups: Groups, observations: Array32, slots: NDArray[np.int64] | None = None, starts: Array | None = None
    ) -> None:
        """Begin the next episode of some groups; see `Simulation.reset`.

        Args:
            groups: their numbers (k,).
            observations: (num_groups * count, size), written in their rows.
            slots: who flies where (k, count), in place of what the scenario says.
            starts: LVLH states (k, count, 6) to start at.
        """
        flown = np.full((len(groups), self.count), -1, np.int64) if slots is None else slots.astype(np.int64)
        states, streams, schedule, seen, packed = self._arrays
        given = starts is not None
        begun = self._nominal_starts if starts is None else starts.swapaxes(0, 1).reshape(-1, 6)
        group_program(self._kinds).reset(
            states,
            streams,
            self._keys,
            schedule,
            seen,
            packed,
            *self._of_groups,
            groups,
            flown,
            np.ascontiguousarray(begun, float),
            given,
            *self._scratch[0],
            observations,
            *self.results.blocks,
        )
        self.slots[groups] = flown
        self._begin_safety(self.rows_of(groups).ravel())

    def arguments(self, observations: Array32, first: int = 0, last: int | None = None) -> tuple[Any, ...]:
        """Arguments of `fly` for the blocks of a part, see `Simulation.arguments`."""
        last = len(self._links) if last is None else last
        own = self._scratch[self._parts.index((first, last))]
        outputs = (self.actions, observations, *self.results.blocks)
        return (*self._arrays, *self._of_groups, self.num_groups, first, last, *own, *outputs)

    def fly(self, arguments: tuple[Any, ...]) -> int:
        """Fly some blocks over one step in this thread; returns how many groups ended."""
        ended: int = group_program(self._kinds).step(*arguments)
        return ended

    def _remembered(self) -> list[Array]:
        return [
            *super()._remembered(),
            *(part.view(np.float64) for part in (self._links, self._sent, self._link_streams, self.gone, self.slots)),
        ]


def scratch(columns: int, count: int) -> tuple[Array, Array32, NDArray[np.intp]]:
    """Scratch space of a thread; see `group_program.scratch_sizes`."""
    size64, size32, size_integers = scratch_sizes(columns, count)
    return np.zeros(size64), np.zeros(size32, np.float32), np.zeros(size_integers, np.intp)


def rules(scenario: Scenario) -> tuple[Array, Array]:
    """`Rules` as a line, and when a window of the links between followers is closed (steps + 1,)."""
    between = scenario.inter_satellite_link
    times_s: Array = scenario.dt_s * np.arange(scenario.num_steps + 1, dtype=float)
    chain = between.dropout.chain(scenario.dt_s, scenario.orbit)
    closed = between.dropout.closed(times_s).astype(float)
    link = LinkSettings(
        scenario.dt_s, between.range_m, chain.stationary_loss, chain.fail, chain.recover, windows=closed.max()
    )
    line = Rules(
        followers=scenario.followers,
        shown=scenario.num_neighbours,
        together=float(scenario.safety.ends == "group"),
        random=float(scenario.slots == "random"),
        link=link,
    )
    return np.array([*line[:-1], *link], float), closed
