"""The sensor: the measurement of the true state, whether or not it arrives."""

from formation_env.kernel.settings import scalars
from formation_env.kernel.tile import STATE, WORK, WORK32
from formation_env.numerics.arrays import Array, Array32
from formation_env.numerics.jit import LANES, tile_function


@tile_function
def sense_position(state: Array, work: Array, work32: Array32, settings: Array, n: int) -> None:
    """Measure positions, m."""
    for k in range(3):
        for i in range(min(n, LANES)):
            noise = scalars(settings, i).sigma_pos * work32[WORK32.sensor_noise + k * LANES + i]
            work[WORK.measurement + k * LANES + i] = state[STATE.true_state + k * LANES + i] + noise


@tile_function
def sense_position_and_velocity(state: Array, work: Array, work32: Array32, settings: Array, n: int) -> None:
    """Measure positions and velocities, m and m/s."""
    sense_position(state, work, work32, settings, n)
    for k in range(3, 6):
        for i in range(min(n, LANES)):
            noise = scalars(settings, i).sigma_vel * work32[WORK32.sensor_noise + k * LANES + i]
            work[WORK.measurement + k * LANES + i] = state[STATE.true_state + k * LANES + i] + noise


KINDS = {"position": sense_position, "position_and_velocity": sense_position_and_velocity}
"""The compiled stage of each kind of sensor."""
