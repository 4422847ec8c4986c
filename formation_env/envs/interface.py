"""What the single and the batched environment have in common: spaces, info, checks."""

import reprlib
from collections.abc import Mapping
from math import isfinite
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from formation_env.kernel import tile as field
from formation_env.kernel.simulation import Simulation
from formation_env.numerics.arrays import Array
from formation_env.task import observation
from formation_env.task.scenario import Scenario

INFO_STATES: Final = {"true_state": (field.TRUTH, 6), "estimate": (field.ESTIMATE, 6)}
"""Info key: first state field, size."""
INFO_THRUST: Final = "accel_m_s2"
INFO_SCALARS: Final[dict[str, tuple[int, type]]] = {
    "position_error_m": (field.POSITION_ERROR, float),
    "delta_v_m_s": (field.DELTA_V, float),
    "error_cost_m_s": (field.ERROR_COST, float),
    "exit_cost_m_s": (field.EXIT_COST, float),
    "nis": (field.NIS, float),
    "measured": (field.MEASURED, bool),
    "phase": (field.PHASE, int),
}
"""Info key: result field, type."""
INFO_VARIANT: Final = {"variant": (field.VARIANT, int)}
"""The same, of scenarios with domain randomization."""
_Float32Space = spaces.Space[NDArray[np.float32]]
TOTALS: Final = "episode_totals"
START_OPTION: Final = "initial_state"


def action_space() -> spaces.Space[NDArray[np.float32]]:
    """LVLH acceleration in units of max_accel_m_s2."""
    return cast(_Float32Space, spaces.Box(-1.0, 1.0, (3,), np.float32))


def observation_space() -> spaces.Space[NDArray[np.float32]]:
    """See `formation_env.task.observation`."""
    return cast(_Float32Space, spaces.Box(-observation.BOUND, observation.BOUND, (observation.SIZE,), np.float32))


def info_scalars(scenario: Scenario) -> dict[str, tuple[int, type]]:
    """The infos of one number that a scenario's environments give: key, result field, type."""
    return INFO_SCALARS if scenario.domain_randomization is None else INFO_SCALARS | INFO_VARIANT


def read_start(options: Mapping[str, Any] | None, simulation: Simulation) -> Array | None:
    """The start given in reset's options, as (num_rows, 6), or None.

    Raises:
        ValueError: an unknown option, or a start of wrong shape, not finite, or beyond the limits of any variant.
    """
    num_rows, limits = simulation.num_rows, simulation.scenario.limits
    unknown = set(options or {}) - {START_OPTION}
    if unknown:
        raise ValueError(f"reset options: unknown {sorted(unknown)}; known: {START_OPTION}")
    if not options or START_OPTION not in options:
        return None
    given = np.asarray(options[START_OPTION], float)
    if given.shape not in ((6,), (num_rows, 6)):
        raise ValueError(f"{START_OPTION}: shape must be (6,) or ({num_rows}, 6), got {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError(f"{START_OPTION}: must be finite, got {given}")
    position, speed = given[..., :3], np.linalg.norm(given[..., 3:], axis=-1)
    if (np.linalg.norm(position, axis=-1) < limits.keep_out_m).any():
        raise ValueError(f"{START_OPTION}: inside the keep-out sphere of {limits.keep_out_m:g} m: {given}")
    distances_m = np.linalg.norm(position[..., None, :] - simulation.first_references_m, axis=-1)
    if (distances_m > limits.max_distance_m).any():
        raise ValueError(f"{START_OPTION}: farther than {limits.max_distance_m:g} m from the reference: {given}")
    if (speed > min(flown.orbit.speed_m_s for flown in simulation.variants)).any():
        raise ValueError(f"{START_OPTION}: faster than the orbit itself: {given}")
    return np.broadcast_to(given, (num_rows, 6))


def check_action(action: Any) -> NDArray[np.float32]:
    """An action as float32 (3,).

    Raises:
        ValueError: wrong shape, no numbers, or not finite.
    """
    array = _numbers(action, "action")
    if array.shape != (3,) or not isfinite(sum(array.tolist())):  # faster than numpy for three numbers
        raise ValueError(f"action: must be finite with shape (3,), got shape {array.shape}: {array}")
    return array


def check_actions(actions: Any, num_rows: int) -> NDArray[np.float32]:
    """Actions as float32 (num_rows, 3).

    Raises:
        ValueError: wrong shape, no numbers, or not finite; then it names the first row that is wrong.
    """
    array = _numbers(actions, "actions")
    if array.shape != (num_rows, 3):
        raise ValueError(f"actions: shape must be ({num_rows}, 3), got {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise ValueError(f"actions: row {row} must be finite, got {array[row]}")
    return array


def _numbers(values: Any, name: str) -> NDArray[np.float32]:
    """Values as float32; never read out of strings or flags."""
    try:
        array = np.asarray(values)
    except ValueError:  # a ragged list
        array = np.empty(0, object)
    if array.dtype.char == "f":
        return array
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: must be numbers, got {reprlib.repr(values)}")
    with np.errstate(over="ignore"):  # what is too large is infinite then, and refused as such
        return array.astype(np.float32)
