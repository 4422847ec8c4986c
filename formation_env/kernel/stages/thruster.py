"""The thruster: from the action to the acceleration that acts."""

import numpy as np

from formation_env.kernel import tile as field
from formation_env.kernel.stages.link import link
from formation_env.kernel.stages.noise import THRUST_NOISE
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Scalars
from formation_env.kernel.variants import own_scalars
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@inline_scalar
def thruster(tile: Array, i: int, settings: Scalars) -> None:
    """Action to acceleration: clipped to the limit, zero below the minimum, with a random relative error."""
    x = settings.max_accel * min(max(tile[field.ACTION + i], -1.0), 1.0)
    y = settings.max_accel * min(max(tile[field.ACTION + LANES + i], -1.0), 1.0)
    z = settings.max_accel * min(max(tile[field.ACTION + 2 * LANES + i], -1.0), 1.0)
    magnitude = np.sqrt(x * x + y * y + z * z)
    fires = 1.0 if magnitude >= settings.min_accel else 0.0
    gain = fires * (1.0 + settings.thrust_noise * tile[THRUST_NOISE + i])
    tile[field.COMMAND + i], tile[field.COMMAND + LANES + i], tile[field.COMMAND + 2 * LANES + i] = (
        fires * x,
        fires * y,
        fires * z,
    )
    tile[field.THRUST + i], tile[field.THRUST + LANES + i], tile[field.THRUST + 2 * LANES + i] = (
        gain * x,
        gain * y,
        gain * z,
    )
    tile[field.DELTA_V + i] = abs(gain) * magnitude * settings.dt_s


@tile_function
def thrust(tile: Array, width: Width, settings: Scalars | None) -> None:
    """Thruster and link."""
    for i in range(len(width)):
        thruster(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        link(tile, i, own_scalars(tile, i, settings))
