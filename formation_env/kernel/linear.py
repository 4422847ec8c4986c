"""A step of a linear model, and models that a row's plan holds."""

from formation_env.dynamics.base import Array
from formation_env.jit import LANES, lane
from formation_env.kernel.packing import Model, ProcessNoise, unpack_model, unpack_process


@lane
def read_model(t: Array, i: int, table: int) -> Model:
    """The row's own model, which the tile has at `table`."""
    return unpack_model(t, table + i, LANES)


@lane
def read_process(t: Array, i: int, table: int) -> ProcessNoise:
    """The row's own process noise, behind the model at `table`."""
    return unpack_process(t, table + i, LANES)


@lane
def propagate(t: Array, i: int, state: int, model: Model, ax: float, ay: float, az: float) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta, in place."""
    x, y, u, v = t[state + i], t[state + LANES + i], t[state + 3 * LANES + i], t[state + 4 * LANES + i]
    z, w = t[state + 2 * LANES + i], t[state + 5 * LANES + i]
    P, G, d = model.Phi_in_plane, model.Gamma_in_plane, model.delta_in_plane
    t[state + i] = P[0] * x + P[1] * y + P[2] * u + P[3] * v + G[0] * ax + G[1] * ay + d[0]
    t[state + LANES + i] = P[4] * x + P[5] * y + P[6] * u + P[7] * v + G[2] * ax + G[3] * ay + d[1]
    t[state + 3 * LANES + i] = P[8] * x + P[9] * y + P[10] * u + P[11] * v + G[4] * ax + G[5] * ay + d[2]
    t[state + 4 * LANES + i] = P[12] * x + P[13] * y + P[14] * u + P[15] * v + G[6] * ax + G[7] * ay + d[3]
    p, g, e = model.Phi_cross_track, model.Gamma_cross_track, model.delta_cross_track
    t[state + 2 * LANES + i] = p[0] * z + p[1] * w + g[0] * az + e[0]
    t[state + 5 * LANES + i] = p[2] * z + p[3] * w + g[1] * az + e[1]
