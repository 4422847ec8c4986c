"""The true motion over one step by a linear model: one for all steps, or one for each."""

from formation_env.kernel.settings import TRUTH, Model, model, scalars
from formation_env.kernel.stages.linear_model import propagate
from formation_env.kernel.tile import STATE, WORK, WORK32
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@tile_function
def push(work: Array, work32: Array32, settings: Array, n: int) -> None:
    """Thrust and random acceleration, both held over the step, along LVLH."""
    for k in range(3):
        for i in range(min(n, LANES)):
            random = scalars(settings, i).process_noise * work32[WORK32.process_noise + k * LANES + i]
            work[WORK.push + k * LANES + i] = work[WORK.thrust + k * LANES + i] + random


@inline_scalar
def move(state: Array, work: Array, i: int, model: Model) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta."""
    a = WORK.push + i
    propagate(state, STATE.true_state + i, model, work[a], work[a + LANES], work[a + 2 * LANES])


@tile_function
def fly_constant(state: Array, work: Array, settings: Array, table: int, n: int) -> None:
    """Fly by the model that the settings hold."""
    for i in range(min(n, LANES)):
        move(state, work, i, model(settings, TRUTH, i))


@tile_function
def fly_varying(state: Array, work: Array, settings: Array, table: int, n: int) -> None:
    """Fly by the model of the row's step, the number `table` of those behind the plan."""
    for i in range(min(n, LANES)):
        move(state, work, i, model(work, table, i))
