"""Spaces, infos and checks of inputs that the single and the batched environment share."""

import copy
import functools
import inspect
import operator
import reprlib
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, Final, ParamSpec, cast

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from formation_env.kernel.simulation import Simulation
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task import observation
from formation_env.task.scenario import Scenario

P = ParamSpec("P")

_Float32Space = spaces.Space[NDArray[np.float32]]
_FLOAT32: Final = np.dtype(np.float32)
START_OPTION: Final = "initial_state"


def action_space() -> spaces.Space[NDArray[np.float32]]:
    """LVLH acceleration in units of max_accel_m_s2."""
    return cast(_Float32Space, spaces.Box(-1.0, 1.0, (3,), np.float32))


def observation_space() -> spaces.Space[NDArray[np.float32]]:
    """See `formation_env.task.observation`."""
    return cast(_Float32Space, spaces.Box(-observation.BOUND, observation.BOUND, (observation.SIZE,), np.float32))


def with_length(spec: EnvSpec | None, max_episode_steps: int) -> EnvSpec | None:
    """A copy of a spec that states the episode's length, unless it states one already.

    The registered specs state none: Gymnasium would cut an environment made with `scenario=` at the length of the
    registered scenario.
    """
    if spec is None or spec.max_episode_steps is not None:
        return spec
    stated = copy.copy(spec)
    stated.max_episode_steps = max_episode_steps
    return stated


def known_arguments(init: Callable[P, None]) -> Callable[P, None]:
    """Make a constructor name the arguments that it does not have, and the place of a scenario's settings."""
    known = inspect.signature(init).parameters

    @functools.wraps(init)
    def checked(*args: P.args, **kwargs: P.kwargs) -> None:
        unknown = [name for name in kwargs if name not in known]
        if unknown:
            name = type(args[0]).__name__
            raise TypeError(
                f"{name}: unknown argument {unknown[0]!r}; settings of the task belong to the scenario: "
                f"scenario=dataclasses.replace(load_scenario('keeping'), {unknown[0]}=...), or the path of a YAML file"
            )
        init(*args, **kwargs)

    return checked


def one_follower(scenario: Scenario, other: str) -> Scenario:
    """A scenario that must have one follower.

    Raises:
        ConfigError: it has several; it names the environment for these.
    """
    if scenario.followers > 1:
        raise ConfigError(f"followers: {scenario.followers}, but this environment flies one; {other} flies several")
    return scenario


def check_seed(seed: Any) -> int | None:
    """A seed as a Python number, or None.

    Raises:
        ValueError: no integer, or negative.
    """
    if seed is None:
        return None
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if number < 0 or isinstance(seed, bool):
        raise ValueError(f"seed: must be an integer >= 0 or None, got {reprlib.repr(seed)}")
    return number


def check_seeds(seed: Any, num_rows: int) -> Sequence[int | None]:
    """The seed of each row: seed + i of a number, the i-th of a list or an array, or None.

    Raises:
        ValueError: no integers, negative ones, or another number of them.
    """
    if seed is None:
        return [None] * num_rows
    if not isinstance(seed, (Sequence, np.ndarray)) or isinstance(seed, (str, bytes)) or np.ndim(seed) == 0:
        first = check_seed(seed)
        assert first is not None
        return range(first, first + num_rows)
    if len(seed) != num_rows:
        raise ValueError(f"seed: a list must have {num_rows} elements, got {len(seed)}")
    return [check_seed(each) for each in seed]


def read_start(options: Mapping[str, Any] | None, simulation: Simulation) -> Array | None:
    """The start given in reset's options, as (num_rows, 6), or None.

    Raises:
        ValueError: an unknown option, or a start without numbers, of wrong shape, not finite, or beyond the limits of
            any variant.
    """
    num_rows = simulation.num_rows
    unknown = set(options or {}) - {START_OPTION}
    if unknown:
        raise ValueError(f"reset options: unknown {sorted(unknown)}; known: {START_OPTION}")
    if not options or START_OPTION not in options:
        return None
    given = numbers(options[START_OPTION], START_OPTION, np.float64)
    if given.shape not in ((6,), (num_rows, 6)):
        raise ValueError(f"{START_OPTION}: shape must be (6,) or ({num_rows}, 6), got {given.shape}")
    check_start(given, simulation)
    return np.broadcast_to(given, (num_rows, 6))


def check_start(given: Array, simulation: Simulation) -> None:
    """Refuse starts (..., 6) that are not finite, or beyond the limits of any variant.

    Raises:
        ValueError: one of them is.
    """
    limits = simulation.scenario.limits
    if not np.isfinite(given).all():
        raise ValueError(f"{START_OPTION}: must be finite, got {given}")
    position, speed = given[..., :3], np.linalg.norm(given[..., 3:], axis=-1)
    if (np.linalg.norm(position, axis=-1) < limits.keep_out_m).any():
        raise ValueError(f"{START_OPTION}: inside the keep-out sphere of {limits.keep_out_m:g} m: {given}")
    distances_m = np.linalg.norm(position[..., None, :] - simulation.first_references_m, axis=-1)
    if (distances_m > limits.max_distance_m).any():
        raise ValueError(f"{START_OPTION}: farther than {limits.max_distance_m:g} m from the reference: {given}")
    if (speed > min(each.orbit.speed_m_s for each in simulation.variants)).any():
        raise ValueError(f"{START_OPTION}: faster than the orbit itself: {given}")


def check_action(action: Any) -> NDArray[np.float32]:
    """An action as float32 (3,).

    Raises:
        ValueError: wrong shape, no numbers, or not finite.
    """
    is_ready = type(action) is np.ndarray and action.dtype is _FLOAT32  # as an action space samples it
    array = action if is_ready else numbers(action, "action", np.float32)
    if array.shape != (3,) or not isfinite(sum(array.tolist())):  # faster than numpy for three numbers
        raise ValueError(f"action: must be finite with shape (3,), got shape {array.shape}: {array}")
    return array


def check_actions(actions: Any, *rows: int) -> NDArray[np.float32]:
    """Actions as float32 (*rows, 3).

    Raises:
        ValueError: wrong shape, no numbers, or not finite; then it names the first row that is wrong.
    """
    array = numbers(actions, "actions", np.float32)
    if array.shape != (*rows, 3):
        raise ValueError(f"actions: shape must be {(*rows, 3)}, got {array.shape}")
    if np.count_nonzero(np.isfinite(array)) < array.size:  # faster than `all`
        row = tuple(np.argwhere(~np.isfinite(array).all(axis=-1))[0].tolist())
        raise ValueError(f"actions: row {', '.join(map(str, row))} must be finite, got {array[row]}")
    return array


def numbers(values: Any, name: str, dtype: type[Any]) -> NDArray[Any]:
    """Values as an array of floats; strings and flags are not taken as numbers.

    Raises:
        ValueError: no numbers, or an array of another library that numpy cannot read.
    """
    if isinstance(values, (list, tuple)) and _holds_flag(values):
        raise ValueError(f"{name}: must be numbers, got {reprlib.repr(values)}")
    try:
        array = np.asarray(values)
    except ValueError:  # a ragged list
        array = np.empty(0, object)
    except (TypeError, RuntimeError) as error:  # a tensor that needs gradients, has no numpy type or is on a device
        raise ValueError(f"{name}: must be numbers that numpy can read: {' '.join(str(error).split())}") from error
    if array.dtype == dtype:
        return array
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: must be numbers, got {reprlib.repr(values)}")
    with np.errstate(over="ignore"):  # values that are too large become infinite, and are refused as such
        return array.astype(dtype)


def _holds_flag(values: Any) -> bool:
    """Whether a list of numbers, or of such lists, holds a bool (numpy would read it as 0 or 1)."""
    if isinstance(values, (list, tuple)):
        return any(_holds_flag(value) for value in values)
    return isinstance(values, (bool, np.bool_))
