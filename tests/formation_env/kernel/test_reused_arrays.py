"""Memory is written again only when nobody can see it any more."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from env_helpers import random_actions

from formation_env import FormationVectorEnv
from formation_env.kernel.reused_arrays import LEAST_BYTES, ReusedArrays, ReusedZeros

LARGE = (8, LEAST_BYTES // 8)


def pool() -> ReusedArrays:
    return ReusedArrays([(LARGE, np.float64), ((3,), np.float64)])


HOLDERS: dict[str, Callable[[tuple[Any, ...]], Any]] = {
    "the array": lambda arrays: arrays[0],
    "the small array": lambda arrays: arrays[1],
    "a view": lambda arrays: arrays[0][2:4].T,
    "a view of a view": lambda arrays: arrays[0][2:4][:, 5:].view(np.uint8),
    "a buffer": lambda arrays: memoryview(arrays[0]),
    "a broadcast": lambda arrays: np.broadcast_to(arrays[0], (2, *LARGE)),
}


@pytest.mark.parametrize("hold", HOLDERS.values(), ids=HOLDERS)
def test_what_somebody_holds_is_not_given_again(hold: Callable[[tuple[Any, ...]], Any]) -> None:
    """Whichever way it is held, and for as long as it is."""
    reused = pool()
    held = hold(reused.take())
    others = [reused.take()[0] for _ in range(9)]
    for other in others:
        other[...] = 7.0
        assert not np.shares_memory(np.asarray(held), other)


def test_what_is_dropped_is_given_again() -> None:
    """Else the pool would be worth nothing; copies of a pool share nothing with it."""
    reused = pool()
    place = reused.take()[0].ctypes.data
    assert reused.take()[0].ctypes.data == place
    assert copy.deepcopy(reused).take()[0].ctypes.data != place


@pytest.mark.parametrize("rows", [4, LEAST_BYTES // 8])
def test_zeros_are_zero_again_but_for_what_is_held(rows: int) -> None:
    """Each time other rows are written; arrays that somebody holds keep what was written into them."""
    zeros, first = ReusedZeros([((2, rows), np.float64), ((1, rows), np.bool_)]), None
    for row in (0, 2, 1, 3):
        arrays = zeros.take_for(np.array([row]))
        assert not any(array.any() for array in arrays)
        for array in arrays:
            array[:, row] = 1
        if first is None:
            first = arrays[0]
    assert first is not None
    assert first[:, 0].all()
    assert first.sum() == 2


@pytest.mark.parametrize("rows", [1, 64, 2048])
def test_results_of_earlier_steps_stay(rows: int) -> None:
    """Observations, rewards, ends and infos that are kept are those that were returned."""
    env = FormationVectorEnv(rows)
    kept = [env.reset(seed=0)]
    copies = [copy.deepcopy(kept[0])]
    for action in random_actions(1, 12, rows):
        result = env.step(action)
        kept.append(result)
        copies.append(copy.deepcopy(result))
    for one, other in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        for name, value in one[-1].items():
            np.testing.assert_array_equal(value, other[-1][name], err_msg=name)
