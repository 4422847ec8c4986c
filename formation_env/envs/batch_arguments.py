"""Arguments that the batched environments share, read and checked."""

import reprlib
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

MASK_OPTION: Final = "reset_mask"


def read_mask(mask: Any, num_rows: int, keyed: bool) -> NDArray[np.intp]:
    """Indices of the rows to reset: all, or those of a mask.

    Raises:
        ValueError: no flags, another number of them, or not all of them before the rows have streams (`keyed`).
    """
    if mask is None:
        return np.arange(num_rows)
    mask = np.asarray(mask)
    if mask.shape != (num_rows,) or mask.dtype != np.bool_:
        raise ValueError(f"{MASK_OPTION}: must be bool ({num_rows},), got {mask.dtype} {mask.shape}")
    if not keyed and not mask.all():
        raise ValueError(f"{MASK_OPTION}: the first reset must be of all rows")
    return np.flatnonzero(mask)


def check_ready(keyed: bool, ended: NDArray[np.intp]) -> None:
    """Refuse a step that needs a reset before it: of all rows, or of those that have ended.

    Raises:
        gymnasium.error.ResetNeeded: it does.
    """
    if not keyed:
        raise gymnasium.error.ResetNeeded("step: call reset first")
    if len(ended):
        rows = reprlib.repr(ended.tolist())
        raise gymnasium.error.ResetNeeded(
            f"step: rows {rows} have ended; reset them with options={{'{MASK_OPTION}': mask}}"
        )


def check_arguments(num_envs: int, render_mode: str | None, max_episode_steps: int | None) -> None:
    """Refuse no rows, a render mode, or no steps."""
    if num_envs < 1:
        raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
    if render_mode is not None:
        raise ValueError(f"render_mode: the batched environment has none, got {render_mode!r}")
    if max_episode_steps is not None and max_episode_steps < 1:
        raise ValueError(f"max_episode_steps: must be at least 1, got {max_episode_steps}")


def read_autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """An autoreset mode, which may be given by its value.

    Raises:
        ValueError: there is no such mode.
    """
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = [each.value for each in AutoresetMode]
        raise ValueError(f"autoreset_mode: must be one of {known}, got {mode!r}") from None
