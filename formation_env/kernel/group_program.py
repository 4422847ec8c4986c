"""The compiled step and reset of groups of followers: the stages of one follower, and those between them.

Rows are padded: follower f of group g is row f * T * LANES + g, where T tiles hold the groups. So tile f * T + b holds
follower f of the groups of block b, and what happens between two followers is a loop over the LANES groups of a block.
"""

from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from formation_env.kernel import packing
from formation_env.kernel.group_scratch import Scratch, group_scratch
from formation_env.kernel.program import (
    TYPES,
    Kinds,
    Rows,
    Streams,
    kinds_of,
    source_hash,
    stages_of,
)
from formation_env.kernel.stages import (
    closest_approach,
    group,
    inter_satellite_link,
    kalman_filter,
    link,
    memory,
    messages,
    neighbour_lines,
    neighbours,
    noise,
    observe,
    plan,
    reward,
    start,
    true_motion,
)
from formation_env.kernel.stages.inter_satellite_link import AGE, LinkSettings, pair, place
from formation_env.kernel.stages.memory import Flags, Integers
from formation_env.kernel.tile import STATE, STATE_SIZE, WORK
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, compiled_program, entry_point, tile_function, whole_vectors
from formation_env.task.members import members
from formation_env.task.scenario import Scenario


class Rules(NamedTuple):
    """Settings of a group, in the order of the line that holds them.

    Attributes:
        followers: how many there are.
        shown: neighbours that an observation shows.
        together: 1 if all end with the first.
        random: 1 if each episode draws who flies where.
        link: of the links between followers.
    """

    followers: float
    shown: float
    together: float
    random: float
    link: LinkSettings


GROUP_TYPES: Final = {
    **TYPES,
    "links": types.float64[:, ::1],
    "sent": types.float64[:, ::1],
    "link_streams": types.uint32[:, ::1],
    "gone": types.float64[:, ::1],
    "rules": types.float64[::1],
    "closed": types.float64[::1],
    "num_groups": types.intp,
    "scratch64": types.float64[::1],
    "scratch32": types.float32[::1],
    "scratch_integers": types.intp[::1],
    "groups": types.intp[::1],
    "slots": types.int64[:, ::1],
}
"""Types of the arguments, see `program.TYPES`."""


class GroupProgram(NamedTuple):
    """The compiled functions for some kinds; see `program.Program` for arguments that are not named here.

    Arguments that they share:
        links: of the blocks (blocks, pairs * PAIR_SIZE * LANES), updated.
        sent: last messages (blocks, `messages.block_size`), updated.
        link_streams: of the links between followers (blocks, 4 * LANES), updated.
        gone: 1 where a follower's episode has ended before its group's (tiles, LANES), updated.
        rules: `Rules`, flat.
        closed: 1 while a dropout window of the links is open, at each instant (steps + 1,).
        scratch64, scratch32, scratch_integers: of `scratch_sizes`; each thread has its own.
        packed: settings of the members, follower by follower and slot by slot (followers^2, SIZE).
        observations: (groups * followers, size), group by group, written.

    Attributes:
        step: fly the groups of the blocks from first to last - 1 over one step; returns how many groups have ended.
        reset: start the next episode of the groups `groups` (k,). `starts` are states (followers * k, 6) to start at,
            follower by follower, if `given`; else of each member. `slots` (k, followers) are who flies where, written;
            a row that begins with -1 is drawn, or 0, 1, ... if slots are fixed.
    """

    step: Any
    reset: Any


def group_kinds(scenario: Scenario) -> Kinds:
    """The kinds that a scenario of several followers needs."""
    return kinds_of(members(scenario)[0][0], 1)._replace(guarded=True)


@cache
def group_program(kinds: Kinds) -> GroupProgram:
    """The compiled functions for some kinds; they are compiled here, or read from the cache on disk."""
    return GroupProgram(*(entry_point(function, GROUP_TYPES) for function in group_dispatchers(kinds)))


@cache
def group_dispatchers(kinds: Kinds) -> GroupProgram:
    """The functions of `group_program` as numba holds them, with what it knows of its cache."""
    sources = source_hash()
    return GroupProgram(_step(kinds, sources), _reset(kinds, sources))


@tile_function
def link_settings(rules: Array) -> LinkSettings:
    """The settings of the links between followers."""
    return LinkSettings(rules[4], rules[5], rules[6], rules[7], rules[8], rules[9])


# Long: its arguments.
@tile_function
def show(
    scratch: Scratch,
    tiles: Array,
    block: int,
    links: Array,
    sent: Array,
    gone: Array,
    shown: int,
    observations: Array32,
    groups: Rows,
    n: int,
) -> None:
    """Write the observations of a block.

    Args:
        scratch: of the block.
        tiles: of all followers and blocks (followers, blocks, STATE_SIZE).
        block: the block.
        links: of the block.
        sent: messages of the block.
        gone: (followers, blocks, LANES).
        shown: neighbours that an observation shows.
        observations: of all groups.
        groups: numbers of the block's groups (n,).
        n: groups.
    """
    count, starts, lines = len(tiles), np.empty(LANES, np.intp), np.empty(LANES, np.intp)
    known, views = scratch.known, scratch.views
    for f in range(count):
        neighbours.scale(tiles[f, block], scratch.works[f], scratch.works32[f], known[f], n)
    for a in range(1, count):
        for c in range(a):
            number = pair(a, c)
            lanes, deaf = scratch.lanes[number], scratch.deaf[number]
            its, age = views[c, a - 1], links[place(number, AGE) :]
            neighbours.meet(known[a], known[c], scratch.works32[a], age, views[a, c], its, n)
            for k in range(deaf):
                lines[k] = messages.line(a, c, count, lanes[k])
            neighbours.remember(known[a], scratch.works32[a], sent, lines, lanes, deaf, views[a, c], scratch.spare_view)
            for k in range(deaf):
                lines[k] = messages.line(c, a, count, lanes[k])
            neighbours.remember(known[c], scratch.works32[c], sent, lines, lanes, deaf, its, scratch.spare_view)
            neighbours.miss(gone[c, block], views[a, c], n)
            neighbours.miss(gone[a, block], its, n)
    flat = observations.reshape(-1)
    for f in range(count):
        observe.observe(tiles[f, block], scratch.works[f], scratch.works32[f], n)
        neighbour_lines.rank(views[f], scratch.ranks, n)
        for i in range(n):
            starts[i] = (groups[i] * count + f) * observations.shape[1]
        neighbour_lines.write(scratch.works32[f], views[f], scratch.ranks, scratch.lines, shown, flat, starts, n)


# Long: numba takes the arrays one by one, and the order of the stages is best read at one place.
def _step(kinds: Kinds, sources: str) -> Any:
    """Compile the step."""
    thrust, move, predict, sense, measure, table = stages_of(kinds)
    side_by_side = kinds.filter_model == packing.CONSTANT  # else the model is that of the row's step

    # Long: see above.
    @compiled_program("group_step", kinds, sources)
    def step(
        states: Array,
        streams: Streams,
        schedule: Array,
        seen: Array32,
        packed: Array,
        links: Array,
        sent: Array,
        link_streams: Streams,
        gone: Array,
        rules: Array,
        closed: Array,
        num_groups: int,
        first: int,
        last: int,
        scratch64: Array,
        scratch32: Array32,
        scratch_integers: Rows,
        actions: Array32,
        observations: Array32,
        results: Array,
        flags: Flags,
        integers: Integers,
        safety: Array,
        noises: Array,
    ) -> int:
        """Fly groups over one step; the arguments are those of `GroupProgram`."""
        count, shown, together = int(rules[0]), int(rules[1]), rules[2] > 0.5
        scratch, totals, spare = (
            group_scratch(scratch64, scratch32, scratch_integers, count),
            np.empty(STATE_SIZE),
            np.zeros(STATE_SIZE),
        )
        works, works32, lanes, deaf = scratch.works, scratch.works32, scratch.lanes, scratch.deaf
        known_lines, numbered = np.full(count, -1), np.empty(LANES, np.intp)
        blocks, between = len(states) // count, link_settings(rules)
        tiles, absent = states.reshape(count, blocks, STATE_SIZE), gone.reshape(count, blocks, LANES)
        ended = 0
        for b in range(first, last):
            n = min(LANES, num_groups - b * LANES)
            own_links, own_sent = links[b], sent[b]
            for f in range(count):
                state, work, work32, row = tiles[f, b], works[f], works32[f], (f * blocks + b) * LANES
                numbers = packed[f * count : f * count + 1]
                plan.advance(state, n)
                if not together:
                    group.stay(state, absent[f, b], n)
                known_lines[f] = plan.read_plan(state, work, work32, schedule, seen, known_lines[f], n)
                noise.draw(streams[f * blocks + b], work32, n)
                thrust(actions, row, work, work32, numbers, n)
                link.change(state, work32, numbers, n)
                true_motion.push(work, work32, numbers, n)
                closest_approach.remember(state, work, n)
                move(state, work, numbers, table, n)
                closest_approach.approach_leader(state, work, numbers, n)
            for a in range(1, count):
                for c in range(a):
                    number = pair(a, c)
                    closest_approach.approach(
                        tiles[a, b], works[a], tiles[c, b], works[c], absent[a, b], absent[c, b], between.dt_s, n
                    )
                    inter_satellite_link.change(own_links, number, link_streams[b], between, n)
                    inter_satellite_link.hear(own_links, number, tiles[a, b], tiles[c, b], between, closed, n)
                    deaf[number] = inter_satellite_link.deaf(own_links, number, lanes[number], n)
            for f in range(count):
                closest_approach.end_approach(works[f], n)
                reward.check_safety(tiles[f, b], works[f], packed[f * count : f * count + 1], n)
            if together:
                group.end_together(works, n)
            for f in range(count):
                state, work, work32, row = tiles[f, b], works[f], works32[f], (f * blocks + b) * LANES
                numbers = packed[f * count : f * count + 1]
                for receiver in range(count):
                    if receiver != f:
                        number = pair(receiver, f)
                        own_lanes, own_deaf = lanes[number], deaf[number]
                        messages.keep(own_sent, receiver, f, count, own_links, own_lanes, own_deaf, state, False)
                predict(state, work, numbers, n)
                messages.no_command(work)
                for receiver in range(count):
                    if receiver != f:
                        own_lanes, own_deaf = lanes[pair(receiver, f)], deaf[pair(receiver, f)]
                        messages.gather(own_sent, receiver, f, count, own_lanes, own_deaf, side_by_side, spare)
                        predict(spare, work, numbers, whole_vectors(own_deaf) if side_by_side else n)
                        messages.put_back(own_sent, receiver, f, count, own_lanes, own_deaf, side_by_side, spare)
                link.receive(state, work, numbers, n)
                sense(state, work, work32, numbers, n)
                if len(noises):
                    kalman_filter.innovate(state, work, n)
                    memory.write_noises(work, work32, numbers, noises, row, n)
                measure(state, work, numbers, n)
                if not together:
                    group.set_aside(state, absent[f, b], totals, n)
                reward.score(state, work, numbers, n)
                if not together:
                    group.leave_out(state, work, absent[f, b], totals, n)
                    for i in range(n):
                        absent[f, b, i] = max(absent[f, b, i], work[WORK.terminated + i])
                memory.write_safety(work, safety, row, n)
                memory.write_results(state, work, results, flags, integers, row, n, False)
            for i in range(n):
                numbered[i] = b * LANES + i
            show(scratch, tiles, b, own_links, own_sent, absent, shown, observations, numbered, n)
            ended += group.count_ended(works, n)
        return ended

    return step


# Long: see `_step`.
def _reset(kinds: Kinds, sources: str) -> Any:
    """Compile the reset of some groups."""
    _, _, _, sense, measure, _ = stages_of(kinds)

    # Long: see above.
    @compiled_program("group_reset", kinds, sources)
    def reset(
        states: Array,
        streams: Streams,
        keys: NDArray[np.uint64],
        schedule: Array,
        seen: Array32,
        packed: Array,
        links: Array,
        sent: Array,
        link_streams: Streams,
        gone: Array,
        rules: Array,
        closed: Array,
        groups: Rows,
        slots: NDArray[np.int64],
        starts: Array,
        given: bool,
        scratch64: Array,
        scratch32: Array32,
        scratch_integers: Rows,
        observations: Array32,
        results: Array,
        flags: Flags,
        integers: Integers,
        safety: Array,
        noises: Array,
    ) -> None:
        """Start the next episode of some groups in a spare block; the arguments are those of `GroupProgram`."""
        count, shown, between = int(rules[0]), int(rules[1]), link_settings(rules)
        scratch = group_scratch(scratch64, scratch32, scratch_integers, count)
        works, works32, lanes, deaf = scratch.works, scratch.works32, scratch.lanes, scratch.deaf
        spares, spare_streams = np.empty((count, STATE_SIZE)), np.empty((count, noise.STREAM_SIZE), np.uint32)
        spare_links, spare_sent = np.empty(links.shape[1]), np.empty(sent.shape[1])
        spare_link_stream, nobody_gone = np.empty(4 * LANES, np.uint32), np.zeros((count, LANES))
        blocks = len(states) // count
        for first in range(0, len(groups), LANES):
            n = min(LANES, len(groups) - first)
            own = groups[first : first + n]
            for i in range(n):
                if slots[first + i, 0] < 0:
                    for f in range(count):
                        slots[first + i, f] = f
                    if rules[3] > 0.5:
                        group.draw_slots(keys, own[i : i + 1], slots[first + i : first + i + 1], 1)
            group.begin_link_streams(spare_link_stream, keys, own, n)
            for f in range(count):
                spare, work, work32, numbers = spares[f], works[f], works32[f], packed[f * count : f * count + 1]
                rows = own + f * blocks * LANES
                start.clear(spare, work)
                for i in range(n):
                    spare[STATE.variant + i] = f * count + slots[first + i, f]
                plan.read_plan(spare, work, work32, schedule, seen, -1, n)
                noise.begin_streams(spare_streams[f], keys, rows, 0, n)
                start.place(spare, starts, given, f * len(groups) + first if given else 0, n)
                noise.draw(spare_streams[f], work32, n)
                start.begin(spare, work32, given, numbers, n)
                closest_approach.remember(spare, work, n)
                closest_approach.approach_leader(spare, work, numbers, n)
            for a in range(1, count):
                for c in range(a):
                    number = pair(a, c)
                    closest_approach.approach(
                        spares[a], works[a], spares[c], works[c], nobody_gone[a], nobody_gone[c], between.dt_s, n
                    )
                    inter_satellite_link.begin(spare_links, number, spare_link_stream, between, n)
                    inter_satellite_link.hear(spare_links, number, spares[a], spares[c], between, closed, n)
                    deaf[number] = inter_satellite_link.deaf(spare_links, number, lanes[number], n)
            for f in range(count):
                spare, work, work32, numbers = spares[f], works[f], works32[f], packed[f * count : f * count + 1]
                rows = own + f * blocks * LANES
                for receiver in range(count):
                    if receiver != f:
                        own_lanes, own_deaf = lanes[pair(receiver, f)], deaf[pair(receiver, f)]
                        messages.keep(spare_sent, receiver, f, count, spare_links, own_lanes, own_deaf, spare, True)
                noise.draw(spare_streams[f], work32, n)
                link.receive(spare, work, numbers, n)
                sense(spare, work, work32, numbers, n)
                if len(noises):
                    kalman_filter.innovate(spare, work, n)
                    memory.scatter_noises(work, noises, rows, 0, n)
                measure(spare, work, numbers, n)
                closest_approach.end_approach(work, n)
                reward.check_safety(spare, work, numbers, n)
                reward.score(spare, work, numbers, n)
                memory.scatter_safety(work, safety, rows, 0, n)
                memory.scatter_state(spare, spare_streams[f], states, streams, rows, 0, n)
                memory.scatter_results(spare, work, results, flags, integers, rows, 0, n)
                for i in range(n):
                    gone[rows[i] // LANES, rows[i] % LANES] = 0.0
            for i in range(n):
                block, lane = own[i] // LANES, own[i] % LANES
                links[block, lane::LANES] = spare_links[i::LANES]
                for k in range(count * count):
                    at = k * LANES * messages.MESSAGE_SIZE
                    to, origin = at + lane * messages.MESSAGE_SIZE, at + i * messages.MESSAGE_SIZE
                    kept = spare_sent[origin : origin + messages.MESSAGE_SIZE]
                    sent[block, to : to + messages.MESSAGE_SIZE] = kept
                link_streams[block, lane::LANES] = spare_link_stream[i::LANES]
            everyone, nobody = spares.reshape(count, 1, STATE_SIZE), nobody_gone.reshape(count, 1, LANES)
            show(scratch, everyone, 0, spare_links, spare_sent, nobody, shown, observations, own, n)

    return reset
