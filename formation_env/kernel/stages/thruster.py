"""The thruster: from the action to the acceleration that acts."""

import numpy as np

from formation_env.kernel.settings import Scalars, scalars
from formation_env.kernel.tile import WORK, WORK32
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@inline_scalar
def ideal(work: Array, work32: Array32, i: int, action: tuple[float, float, float], settings: Scalars) -> None:
    """Any thrust at any time: clipped to the limit, zero below the minimum, with a random relative error."""
    x = settings.max_accel * min(max(action[0], -1.0), 1.0)
    y = settings.max_accel * min(max(action[1], -1.0), 1.0)
    z = settings.max_accel * min(max(action[2], -1.0), 1.0)
    magnitude = np.sqrt(x * x + y * y + z * z)
    fires = 1.0 if magnitude >= settings.min_accel else 0.0
    gain = fires * (1.0 + settings.thrust_noise * work32[WORK32.thrust_noise + i])
    command, thrust = WORK.command + i, WORK.thrust + i
    work[command], work[command + LANES], work[command + 2 * LANES] = fires * x, fires * y, fires * z
    work[thrust], work[thrust + LANES], work[thrust + 2 * LANES] = gain * x, gain * y, gain * z
    work[WORK.delta_v + i] = abs(gain) * magnitude * settings.dt_s


@tile_function
def thrust_ideal(actions: Array32, first: int, work: Array, work32: Array32, settings: Array, n: int) -> None:
    """Turn the actions (rows, 3) from row `first` on into accelerations."""
    # Flat and from the first on, so that the compiler knows the stride and sees that no index is negative.
    own = actions.reshape(-1)[3 * first :]
    for i in range(min(n, LANES)):
        action = float(own[3 * i]), float(own[3 * i + 1]), float(own[3 * i + 2])
        ideal(work, work32, i, action, scalars(settings, i))


KINDS = {"ideal": thrust_ideal}
"""The compiled stage of each kind of thruster."""
