"""A step of a linear model, and models that a row's plan holds."""

from formation_env.kernel.unpacking import Model, ProcessNoise, unpack_model, unpack_process
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar


@inline_scalar
def read_model(tile: Array, i: int, table: int) -> Model:
    """The row's own model, which the tile has at `table`."""
    return unpack_model(tile, table + i, LANES)


@inline_scalar
def read_process(tile: Array, i: int, table: int) -> ProcessNoise:
    """The row's own process noise, behind the model at `table`."""
    return unpack_process(tile, table + i, LANES)


@inline_scalar
def propagate(tile: Array, i: int, state: int, model: Model, ax: float, ay: float, az: float) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta, in place."""
    x, y, u, v = tile[state + i], tile[state + LANES + i], tile[state + 3 * LANES + i], tile[state + 4 * LANES + i]
    z, w = tile[state + 2 * LANES + i], tile[state + 5 * LANES + i]
    P, G, d = model.Phi_in_plane, model.Gamma_in_plane, model.delta_in_plane
    tile[state + i] = P[0] * x + P[1] * y + P[2] * u + P[3] * v + G[0] * ax + G[1] * ay + d[0]
    tile[state + LANES + i] = P[4] * x + P[5] * y + P[6] * u + P[7] * v + G[2] * ax + G[3] * ay + d[1]
    tile[state + 3 * LANES + i] = P[8] * x + P[9] * y + P[10] * u + P[11] * v + G[4] * ax + G[5] * ay + d[2]
    tile[state + 4 * LANES + i] = P[12] * x + P[13] * y + P[14] * u + P[15] * v + G[6] * ax + G[7] * ay + d[3]
    p, g, e = model.Phi_cross_track, model.Gamma_cross_track, model.delta_cross_track
    tile[state + 2 * LANES + i] = p[0] * z + p[1] * w + g[0] * az + e[0]
    tile[state + 5 * LANES + i] = p[2] * z + p[3] * w + g[1] * az + e[1]
