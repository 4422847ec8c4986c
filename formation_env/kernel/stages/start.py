"""The start of an episode."""

from typing import Final

from formation_env.kernel.settings import Scalars, scalars
from formation_env.kernel.tile import STATE, STATE_SIZE, WORK, WORK32
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function, turns

START_NORMALS: Final = WORK32.process_noise


@tile_function
def place(state: Array, starts: Array, given: bool, first: int, n: int) -> None:
    """Put the rows at their given starts, or at the nominal starts of their variants."""
    for i in range(n):
        source = first + i if given else int(state[STATE.variant + i])
        for k in range(6):
            state[STATE.true_state + k * LANES + i] = starts[source, k]


@inline_scalar
def deviate(state: Array, work32: Array32, i: int, k: int, given: bool, sigma: float) -> None:
    """Give one axis its random error.

    The truth deviates from the nominal start, which is the filter's first estimate; if the start was given, the truth
    is exactly there and the estimate deviates. Either way the initial error has the sigmas of `scenario.Start`.
    """
    start = state[STATE.true_state + k * LANES + i]
    deviated = start + sigma * work32[START_NORMALS + k * LANES + i]
    state[STATE.true_state + k * LANES + i] = start if given else deviated
    state[STATE.estimate + k * LANES + i] = deviated if given else start


@inline_scalar
def first_doubt(state: Array, i: int, settings: Scalars) -> None:
    """The filter's first covariance."""
    p, q = STATE.covariance_in_plane + i, STATE.covariance_cross_track + i
    for diagonal in (p, p + 4 * LANES, q):
        state[diagonal] = settings.initial_variance_pos
    for diagonal in (p + 7 * LANES, p + 9 * LANES, q + 2 * LANES):
        state[diagonal] = settings.initial_variance_vel


@tile_function
def clear(state: Array, work: Array) -> None:
    """Begin with zeros."""
    for k in range(STATE_SIZE):
        state[k] = 0.0
    for k in range(WORK.thrust, WORK.thrust + 3 * LANES):
        work[k] = 0.0
    for i in range(LANES):
        work[WORK.delta_v + i] = 0.0


@tile_function
def begin(state: Array, work32: Array32, given: bool, settings: Array, n: int) -> None:
    """Start an episode in each row."""
    for k in range(turns(6, state)):
        for i in range(min(n, LANES)):
            own = scalars(settings, i)
            deviate(state, work32, i, k, given, own.spread_pos if k < 3 else own.spread_vel)
    for i in range(min(n, LANES)):
        own = scalars(settings, i)
        first_doubt(state, i, own)
        state[STATE.link_up + i] = 1.0 if work32[WORK32.link_noise + i] >= own.link_loss else 0.0
        state[STATE.measurement_age + i] = -own.dt_s  # 0 at the first measurement, whether it arrives or not
