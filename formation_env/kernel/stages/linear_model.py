"""A step of a linear model."""

from formation_env.kernel.settings import Model
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar


@inline_scalar
def propagate(state: Array, at: int, model: Model, ax: float, ay: float, az: float) -> None:
    """x(k+1) = Phi x(k) + Gamma a + delta, in place, for the row whose state begins at `at`."""
    x, y, u, v = state[at], state[at + LANES], state[at + 3 * LANES], state[at + 4 * LANES]
    z, w = state[at + 2 * LANES], state[at + 5 * LANES]
    P, G, d = model.Phi_in_plane, model.Gamma_in_plane, model.delta_in_plane
    state[at] = P[0] * x + P[1] * y + P[2] * u + P[3] * v + G[0] * ax + G[1] * ay + d[0]
    state[at + LANES] = P[4] * x + P[5] * y + P[6] * u + P[7] * v + G[2] * ax + G[3] * ay + d[1]
    state[at + 3 * LANES] = P[8] * x + P[9] * y + P[10] * u + P[11] * v + G[4] * ax + G[5] * ay + d[2]
    state[at + 4 * LANES] = P[12] * x + P[13] * y + P[14] * u + P[15] * v + G[6] * ax + G[7] * ay + d[3]
    p, g, e = model.Phi_cross_track, model.Gamma_cross_track, model.delta_cross_track
    state[at + 2 * LANES] = p[0] * z + p[1] * w + g[0] * az + e[0]
    state[at + 5 * LANES] = p[2] * z + p[3] * w + g[1] * az + e[1]
