"""The Kalman filter of a row (see `kalman`)."""

from formation_env.kernel import kalman
from formation_env.kernel.settings import FILTER, Model, ProcessNoise, model, process_noise, scalars
from formation_env.kernel.stages.linear_model import propagate
from formation_env.kernel.tile import MODELS, STATE, WORK
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES, inline_scalar, tile_function


@inline_scalar
def time_update(state: Array, work: Array, i: int, model: Model, noise: ProcessNoise) -> None:
    """The estimate and its covariance over one step (Ma 2009, eq. 4.74-4.75)."""
    c, p = WORK.command + i, STATE.covariance_cross_track + i
    propagate(state, STATE.estimate + i, model, work[c], work[c + LANES], work[c + 2 * LANES])
    P = kalman.time_update_4(_load_10(state, STATE.covariance_in_plane + i), model.Phi_in_plane, noise.Q_in_plane)
    _store_10(state, STATE.covariance_in_plane + i, P)
    C = kalman.time_update_2(
        (state[p], state[p + LANES], state[p + 2 * LANES]), model.Phi_cross_track, noise.Q_cross_track
    )
    state[p], state[p + LANES], state[p + 2 * LANES] = C


@inline_scalar
def doubt_thrust(state: Array, work: Array, i: int, model: Model, variance: float) -> None:
    """Add the uncertainty of a thrust whose magnitude has a relative error of this variance."""
    c, p = WORK.command + i, STATE.covariance_cross_track + i
    P = _load_10(state, STATE.covariance_in_plane + i)
    P = kalman.thrust_noise_update_4(P, model.Gamma_in_plane, work[c], work[c + LANES], variance)
    _store_10(state, STATE.covariance_in_plane + i, P)
    C = (state[p], state[p + LANES], state[p + 2 * LANES])
    C = kalman.thrust_noise_update_2(C, model.Gamma_cross_track, work[c + 2 * LANES], variance)
    state[p], state[p + LANES], state[p + 2 * LANES] = C


@tile_function
def predict_constant(state: Array, work: Array, settings: Array, n: int) -> None:
    """Update in time by the model that the settings hold."""
    for i in range(min(n, LANES)):
        time_update(state, work, i, model(settings, FILTER, i), process_noise(settings, FILTER, i))
    if settings.ndim == 1 or scalars(settings, 0).filter_thrust_variance > 0.0:
        for i in range(min(n, LANES)):
            variance = scalars(settings, i).filter_thrust_variance
            doubt_thrust(state, work, i, model(settings, FILTER, i), variance)


@tile_function
def predict_varying(state: Array, work: Array, settings: Array, n: int) -> None:
    """Update in time by the model of the row's step, which stands behind the plan."""
    for i in range(min(n, LANES)):
        time_update(state, work, i, model(work, MODELS, i), process_noise(work, MODELS, i))
    for i in range(min(n, LANES)):
        doubt_thrust(state, work, i, model(work, MODELS, i), scalars(settings, i).filter_thrust_variance)


@inline_scalar
def take_positions(state: Array, work: Array, i: int, variance: float) -> None:
    """Measurement update with three positions (Ma 2009, eq. 4.71-4.73)."""
    x, p, z = STATE.estimate + i, STATE.covariance_cross_track + i, WORK.measurement + i
    received = state[STATE.measured + i]
    (x0, x1, x3, x4), P, nis_plane = kalman.measure_pair_4(
        (state[x], state[x + LANES], state[x + 3 * LANES], state[x + 4 * LANES]),
        _load_10(state, STATE.covariance_in_plane + i),
        (work[z], work[z + LANES]),
        variance,
        received,
    )
    _store_10(state, STATE.covariance_in_plane + i, P)
    C = (state[p], state[p + LANES], state[p + 2 * LANES])
    (x2, x5), C, nis = kalman.measure_first_2(
        (state[x + 2 * LANES], state[x + 5 * LANES]), C, work[z + 2 * LANES], variance, received
    )
    state[p], state[p + LANES], state[p + 2 * LANES] = C
    state[x], state[x + LANES], state[x + 2 * LANES] = x0, x1, x2
    state[x + 3 * LANES], state[x + 4 * LANES], state[x + 5 * LANES] = x3, x4, x5
    work[WORK.nis + i] = nis_plane + nis


@inline_scalar
def take_velocities(state: Array, work: Array, i: int, variance: float) -> None:
    """Measurement update with three velocities."""
    x, p, z = STATE.estimate + i, STATE.covariance_cross_track + i, WORK.measurement + i
    received = state[STATE.measured + i]
    (x0, x1, x3, x4), P, nis_plane = kalman.measure_velocities_4(
        (state[x], state[x + LANES], state[x + 3 * LANES], state[x + 4 * LANES]),
        _load_10(state, STATE.covariance_in_plane + i),
        (work[z + 3 * LANES], work[z + 4 * LANES]),
        variance,
        received,
    )
    _store_10(state, STATE.covariance_in_plane + i, P)
    C = (state[p], state[p + LANES], state[p + 2 * LANES])
    (x2, x5), C, nis = kalman.measure_second_2(
        (state[x + 2 * LANES], state[x + 5 * LANES]), C, work[z + 5 * LANES], variance, received
    )
    state[p], state[p + LANES], state[p + 2 * LANES] = C
    state[x], state[x + LANES], state[x + 2 * LANES] = x0, x1, x2
    state[x + 3 * LANES], state[x + 4 * LANES], state[x + 5 * LANES] = x3, x4, x5
    work[WORK.nis + i] += nis_plane + nis


@tile_function
def measure_position(state: Array, work: Array, settings: Array, n: int) -> None:
    """Take positions."""
    for i in range(min(n, LANES)):
        take_positions(state, work, i, scalars(settings, i).filter_variance_pos)


@tile_function
def measure_position_and_velocity(state: Array, work: Array, settings: Array, n: int) -> None:
    """Take positions, then velocities."""
    measure_position(state, work, settings, n)
    for i in range(min(n, LANES)):
        take_velocities(state, work, i, scalars(settings, i).filter_variance_vel)


@tile_function
def innovate(state: Array, work: Array, n: int) -> None:
    """Measurement minus its prediction, for those who ask."""
    for k in range(6):
        for i in range(min(n, LANES)):
            innovation = work[WORK.measurement + k * LANES + i] - state[STATE.estimate + k * LANES + i]
            work[WORK.innovation + k * LANES + i] = innovation


@inline_scalar
def _load_10(state: Array, k: int) -> kalman.Symmetric4:
    return (
        state[k],
        state[k + LANES],
        state[k + 2 * LANES],
        state[k + 3 * LANES],
        state[k + 4 * LANES],
        state[k + 5 * LANES],
        state[k + 6 * LANES],
        state[k + 7 * LANES],
        state[k + 8 * LANES],
        state[k + 9 * LANES],
    )


@inline_scalar
def _store_10(state: Array, k: int, P: kalman.Symmetric4) -> None:
    state[k], state[k + LANES], state[k + 2 * LANES], state[k + 3 * LANES], state[k + 4 * LANES] = P[:5]
    k += 5 * LANES
    state[k], state[k + LANES], state[k + 2 * LANES], state[k + 3 * LANES], state[k + 4 * LANES] = P[5:]


PREDICT = {"constant": predict_constant, "varying": predict_varying}
"""The compiled time update of each kind of the filter's model."""
MEASURE = {"position": measure_position, "position_and_velocity": measure_position_and_velocity}
"""The compiled measurement update of each kind of sensor."""
