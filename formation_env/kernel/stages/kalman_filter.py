"""The Kalman filter of a row of a tile (see `kalman`)."""

from formation_env.kernel import kalman
from formation_env.kernel import tile as field
from formation_env.kernel.stages.linear_model import propagate, read_model, read_process
from formation_env.kernel.stages.link import dropout
from formation_env.kernel.stages.noise import FIRST_SENSOR_NOISE
from formation_env.kernel.tile import Width
from formation_env.kernel.unpacking import Model, ProcessNoise, Scalars, SensorNoise
from formation_env.kernel.variants import own_scalars, own_sensor
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@inline_scalar
def filter_time_update(tile: Array, i: int, model: Model, noise: ProcessNoise, settings: Scalars) -> None:
    """The estimate and its covariance over one step (Ma 2009, eq. 4.74-4.75)."""
    ax, ay, az = tile[field.COMMAND + i], tile[field.COMMAND + LANES + i], tile[field.COMMAND + 2 * LANES + i]
    propagate(tile, i, field.ESTIMATE, model, ax, ay, az)
    P = kalman.time_update_4(_load_10(tile, field.P_IN_PLANE + i), model.Phi_in_plane, noise.Q_in_plane)
    P = kalman.thrust_noise_update_4(P, model.Gamma_in_plane, ax, ay, settings.filter_thrust_variance)
    _store_10(tile, field.P_IN_PLANE + i, P)
    p = field.P_CROSS_TRACK + i
    C = kalman.time_update_2(
        (tile[p], tile[p + LANES], tile[p + 2 * LANES]), model.Phi_cross_track, noise.Q_cross_track
    )
    C = kalman.thrust_noise_update_2(C, model.Gamma_cross_track, az, settings.filter_thrust_variance)
    tile[p], tile[p + LANES], tile[p + 2 * LANES] = C


@inline_scalar
def filter_measurement_update(tile: Array, i: int, sensor: SensorNoise, settings: Scalars) -> None:
    """Measure the true state and take in what arrives (Ma 2009, eq. 4.71-4.73)."""
    n, truth, x = FIRST_SENSOR_NOISE + i, field.TRUTH + i, field.ESTIMATE + i
    received = (sensor.measures[0] * tile[field.MEASURED + i], sensor.measures[1] * tile[field.MEASURED + i])
    plane = (
        tile[truth] + settings.sigma_pos * tile[n],
        tile[truth + LANES] + settings.sigma_pos * tile[n + LANES],
        tile[truth + 3 * LANES] + settings.sigma_vel * tile[n + 3 * LANES],
        tile[truth + 4 * LANES] + settings.sigma_vel * tile[n + 4 * LANES],
    )
    cross = (
        tile[truth + 2 * LANES] + settings.sigma_pos * tile[n + 2 * LANES],
        tile[truth + 5 * LANES] + settings.sigma_vel * tile[n + 5 * LANES],
    )
    (x0, x1, x3, x4), P, nis_plane = kalman.measurement_update_4(
        (tile[x], tile[x + LANES], tile[x + 3 * LANES], tile[x + 4 * LANES]),
        _load_10(tile, field.P_IN_PLANE + i),
        plane,
        sensor.variances,
        received,
    )
    _store_10(tile, field.P_IN_PLANE + i, P)
    p = field.P_CROSS_TRACK + i
    (x2, x5), (p0, p1, p2), nis_cross = kalman.measurement_update_2(
        (tile[x + 2 * LANES], tile[x + 5 * LANES]),
        (tile[p], tile[p + LANES], tile[p + 2 * LANES]),
        cross,
        sensor.variances,
        received,
    )
    tile[p], tile[p + LANES], tile[p + 2 * LANES] = p0, p1, p2
    tile[x], tile[x + LANES], tile[x + 2 * LANES] = x0, x1, x2
    tile[x + 3 * LANES], tile[x + 4 * LANES], tile[x + 5 * LANES] = x3, x4, x5
    tile[field.NIS + i] = nis_plane + nis_cross


@inline_scalar
def _load_10(tile: Array, k: int) -> kalman.Symmetric4:
    return (
        tile[k],
        tile[k + LANES],
        tile[k + 2 * LANES],
        tile[k + 3 * LANES],
        tile[k + 4 * LANES],
        tile[k + 5 * LANES],
        tile[k + 6 * LANES],
        tile[k + 7 * LANES],
        tile[k + 8 * LANES],
        tile[k + 9 * LANES],
    )


@inline_scalar
def _store_10(tile: Array, k: int, P: kalman.Symmetric4) -> None:
    tile[k], tile[k + LANES], tile[k + 2 * LANES], tile[k + 3 * LANES], tile[k + 4 * LANES] = (
        P[0],
        P[1],
        P[2],
        P[3],
        P[4],
    )
    tile[k + 5 * LANES], tile[k + 6 * LANES], tile[k + 7 * LANES], tile[k + 8 * LANES], tile[k + 9 * LANES] = (
        P[5],
        P[6],
        P[7],
        P[8],
        P[9],
    )


@tile_function
def predict(tile: Array, width: Width, model: Model, noise: ProcessNoise, settings: Scalars) -> None:
    """The filter's time update, by one model."""
    for i in range(len(width)):
        filter_time_update(tile, i, model, noise, settings)


@tile_function
def predict_varying(tile: Array, width: Width, table: int, settings: Scalars | None) -> None:
    """Update in time by the model of the row, which stands in the tile at `table`."""
    for i in range(len(width)):
        model, noise = read_model(tile, i, table), read_process(tile, i, table)
        filter_time_update(tile, i, model, noise, own_scalars(tile, i, settings))


@tile_function
def measure(tile: Array, width: Width, sensor: SensorNoise | None, settings: Scalars | None) -> None:
    """Measurement and the filter's measurement update."""
    for i in range(len(width)):
        dropout(tile, i, own_scalars(tile, i, settings))
    for i in range(len(width)):
        filter_measurement_update(tile, i, own_sensor(tile, i, sensor), own_scalars(tile, i, settings))
