"""Options of `reset` for groups of followers."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.envs import interface
from formation_env.kernel.group_simulation import GroupSimulation
from formation_env.numerics.arrays import Array

SLOTS_OPTION: Final = "slots"
KNOWN: Final = (interface.START_OPTION, SLOTS_OPTION)


def read(
    options: Mapping[str, Any] | None, simulation: GroupSimulation
) -> tuple[NDArray[np.int64] | None, Array | None]:
    """Slots (groups, followers) and starts (groups, followers, 6) given in reset's options, or None.

    Raises:
        ValueError: an unknown option, slots that are no order of all slots, or starts that `interface.check_start`
            refuses.
    """
    unknown = set(options or {}) - set(KNOWN)
    if unknown:
        raise ValueError(f"reset options: unknown {sorted(unknown)}; known: {', '.join(KNOWN)}")
    given = dict(options or {})
    groups, count = simulation.num_groups, simulation.count
    slots = _slots(given[SLOTS_OPTION], groups, count) if SLOTS_OPTION in given else None
    if interface.START_OPTION not in given:
        return slots, None
    starts = interface.numbers(given[interface.START_OPTION], interface.START_OPTION, np.float64)
    shapes = ((count, 6), (groups, count, 6))
    if starts.shape not in shapes:
        raise ValueError(f"{interface.START_OPTION}: shape must be {shapes[0]} or {shapes[1]}, got {starts.shape}")
    interface.check_start(starts, simulation)
    return slots, np.broadcast_to(starts, shapes[1])


def _slots(given: Any, groups: int, count: int) -> NDArray[np.int64]:
    """Slots of each group (groups, followers)."""
    slots = np.asarray(given)
    if slots.dtype.kind not in "iu" or slots.shape not in ((count,), (groups, count)):
        raise ValueError(f"{SLOTS_OPTION}: must be integers ({count},) or ({groups}, {count}), got {given!r}")
    if (np.sort(slots, axis=-1) != np.arange(count)).any():
        raise ValueError(f"{SLOTS_OPTION}: each of 0 to {count - 1} must appear once, got {given!r}")
    return np.broadcast_to(slots.astype(np.int64), (groups, count))
