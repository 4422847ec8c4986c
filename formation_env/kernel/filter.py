"""The Kalman filter of a row of a tile (see `estimation`)."""

from formation_env import estimation
from formation_env.dynamics.base import Array
from formation_env.jit import LANES, lane
from formation_env.kernel import lanes
from formation_env.kernel import tile as f
from formation_env.kernel.linear import propagate
from formation_env.kernel.packing import Model, ProcessNoise, Scalars, SensorNoise


@lane
def filter_time_update(t: Array, i: int, model: Model, noise: ProcessNoise, c: Scalars) -> None:
    """The estimate and its covariance over one step (Ma 2009, eq. 4.74-4.75)."""
    ax, ay, az = t[f.COMMAND + i], t[f.COMMAND + LANES + i], t[f.COMMAND + 2 * LANES + i]
    propagate(t, i, f.ESTIMATE, model, ax, ay, az)
    P = estimation.time_update_4(_load_10(t, f.P_IN_PLANE + i), model.Phi_in_plane, noise.Q_in_plane)
    P = estimation.thrust_noise_update_4(P, model.Gamma_in_plane, ax, ay, c.believed_thrust_variance)
    _store_10(t, f.P_IN_PLANE + i, P)
    p = f.P_CROSS_TRACK + i
    C = estimation.time_update_2((t[p], t[p + LANES], t[p + 2 * LANES]), model.Phi_cross_track, noise.Q_cross_track)
    C = estimation.thrust_noise_update_2(C, model.Gamma_cross_track, az, c.believed_thrust_variance)
    t[p], t[p + LANES], t[p + 2 * LANES] = C


@lane
def filter_measurement_update(t: Array, i: int, sensor: SensorNoise, c: Scalars) -> None:
    """Measure the true state and take in what arrives (Ma 2009, eq. 4.71-4.73)."""
    n, truth, x = lanes.FIRST_SENSOR_NOISE + i, f.TRUTH + i, f.ESTIMATE + i
    received = (sensor.measures[0] * t[f.MEASURED + i], sensor.measures[1] * t[f.MEASURED + i])
    plane = (
        t[truth] + c.sigma_pos * t[n],
        t[truth + LANES] + c.sigma_pos * t[n + LANES],
        t[truth + 3 * LANES] + c.sigma_vel * t[n + 3 * LANES],
        t[truth + 4 * LANES] + c.sigma_vel * t[n + 4 * LANES],
    )
    cross = (
        t[truth + 2 * LANES] + c.sigma_pos * t[n + 2 * LANES],
        t[truth + 5 * LANES] + c.sigma_vel * t[n + 5 * LANES],
    )
    (x0, x1, x3, x4), P, nis_plane = estimation.measurement_update_4(
        (t[x], t[x + LANES], t[x + 3 * LANES], t[x + 4 * LANES]),
        _load_10(t, f.P_IN_PLANE + i),
        plane,
        sensor.variances,
        received,
    )
    _store_10(t, f.P_IN_PLANE + i, P)
    p = f.P_CROSS_TRACK + i
    (x2, x5), (p0, p1, p2), nis_cross = estimation.measurement_update_2(
        (t[x + 2 * LANES], t[x + 5 * LANES]),
        (t[p], t[p + LANES], t[p + 2 * LANES]),
        cross,
        sensor.variances,
        received,
    )
    t[p], t[p + LANES], t[p + 2 * LANES] = p0, p1, p2
    t[x], t[x + LANES], t[x + 2 * LANES] = x0, x1, x2
    t[x + 3 * LANES], t[x + 4 * LANES], t[x + 5 * LANES] = x3, x4, x5
    t[f.NIS + i] = nis_plane + nis_cross


@lane
def _load_10(t: Array, k: int) -> estimation.Symmetric4:
    return (
        t[k],
        t[k + LANES],
        t[k + 2 * LANES],
        t[k + 3 * LANES],
        t[k + 4 * LANES],
        t[k + 5 * LANES],
        t[k + 6 * LANES],
        t[k + 7 * LANES],
        t[k + 8 * LANES],
        t[k + 9 * LANES],
    )


@lane
def _store_10(t: Array, k: int, P: estimation.Symmetric4) -> None:
    t[k], t[k + LANES], t[k + 2 * LANES], t[k + 3 * LANES], t[k + 4 * LANES] = P[0], P[1], P[2], P[3], P[4]
    t[k + 5 * LANES], t[k + 6 * LANES], t[k + 7 * LANES], t[k + 8 * LANES], t[k + 9 * LANES] = (
        P[5],
        P[6],
        P[7],
        P[8],
        P[9],
    )
