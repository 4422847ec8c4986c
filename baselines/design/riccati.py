"""Linear quadratic regulators: gains from Riccati equations.

Legend: A, B and Phi, Gamma continuous and discrete model; Q, R weights; P cost-to-go; K gain of u = -K x; y_d desired
state, g its pull in u = -R^-1 B' P x + R^-1 B' g.
"""

from typing import Final

import control
import numpy as np
from scipy.integrate import solve_ivp

from baselines.design.riccati_solver import check_state_weights, in_some_units, no_regulator
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import compiled_loop
from formation_env.settings import ConfigError

SLOWEST_FADING: Final = 1e-9
"""Least share of an error that a regulator takes off in a step (or a second); less is rounding, or drag."""
OVERLOAD: Final = 10.0
"""Extra cost of a control beyond the limit in `least_fuel_gains`, per limit."""


def stationary(Phi: Array, Gamma: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Gain (3, 6) and cost-to-go (6, 6) of the infinite horizon in discrete time, by python-control.

    Args:
        Phi: state transition matrix (6, 6) over the step.
        Gamma: input matrix (6, 3).
        Q: state weight (6, 6).
        R: control weight (3, 3).

    Raises:
        ConfigError: these weights give no stable regulator.
    """
    check_state_weights(Q)
    # c^(-1/2) is the time constant of the loop, s
    c = np.sqrt(np.trace(Q[:3, :3]) / np.trace(R)) or 1.0

    def solve(factor: float) -> tuple[Array, Array, Array]:
        # In units of the loop itself (c per s^2 of acceleration, c^(-1/2) s of time): in SI the solver fails at times.
        unit = c * factor
        scale = np.repeat([1.0, np.sqrt(unit)], 3)
        K, P, poles = control.dlqr(
            Phi * scale / scale[:, None], Gamma * unit / scale[:, None], Q * np.outer(scale, scale), R * unit**2
        )
        return np.asarray(unit * K / scale), np.asarray(P / np.outer(scale, scale)), np.abs(poles)

    K, P, sizes = in_some_units(solve, no_regulator(Q, R))
    if not sizes.max() < 1 - SLOWEST_FADING:
        raise ConfigError(no_regulator(Q, R))
    return K, P


def continuous_gain(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Gain (3, 6) and cost-to-go (6, 6) of the infinite horizon in continuous time (Ma 2009, eq. 4.18).

    Args:
        A: state matrix (6, 6).
        B: control matrix (6, 3).
        Q: state weight (6, 6).
        R: control weight (3, 3).

    Raises:
        ConfigError: these weights give no stable regulator.
    """
    check_state_weights(Q)

    def solve(factor: float) -> tuple[Array, Array, Array]:
        # time in units of 1 / factor s: velocities and rates change by the factor, the control by its square
        scale = np.repeat([1.0, factor], 3)
        K, P, poles = control.lqr(
            A * scale / scale[:, None] / factor, B * factor / scale[:, None], Q * np.outer(scale, scale), R * factor**4
        )
        return np.asarray(factor**2 * K / scale), np.asarray(factor * P / np.outer(scale, scale)), poles.real

    K, P, growth = in_some_units(solve, no_regulator(Q, R))
    if not growth.max() < -SLOWEST_FADING:
        raise ConfigError(no_regulator(Q, R))
    return K, P


def integrate_tracking(
    A: Array, B: Array, Q: Array, R: Array, times_s: Array, desired: Array, P_end: Array, g_end: Array
) -> tuple[Array, Array]:
    """P and g of a finite horizon in continuous time, integrated backwards (Ma 2009, eq. 4.13-4.14, 4.17).

    They minimise the integral of (x - y_d)' Q (x - y_d) + u' R u, plus x' P_end x - 2 x' g_end at the end (Anderson &
    Moore, Optimal Control, section 4.1). P is the regulator's, whatever y_d. Ma 2009, eq. (4.19), drops g'.

    Args:
        A: state matrix (m, m).
        B: control matrix (m, k).
        Q: state weight (m, m).
        R: control weight (k, k).
        times_s: increasing instants (T,), s.
        desired: y_d (T, m) at the instants; straight between them.
        P_end: terminal weight (m, m).
        g_end: terminal pull (m,); P_end y_d for a weight of the last error.

    Returns:
        P (T, m, m) and g (T, m) at the instants.
    """
    size, control_cost = len(A), B @ np.linalg.solve(R, B.T)

    def rates(time_s: float, packed: Array) -> Array:
        P, g = packed[:-size].reshape(size, size), packed[-size:]
        # P' + A' P + P A - P B R^-1 B' P + Q = 0 (4.13)
        half = P @ A - 0.5 * P @ control_cost @ P
        # g' = -(A - B R^-1 B' P)' g - Q y_d
        g_rate = -(A - control_cost @ P).T @ g - Q @ _between(time_s, times_s, desired)
        return np.concatenate([(-half - half.T - Q).ravel(), g_rate])

    end, span = np.concatenate([P_end.ravel(), g_end]), (times_s[-1], times_s[0])
    packed = solve_ivp(rates, span, end, "DOP853", t_eval=times_s[::-1], rtol=1e-8, atol=1e-8).y.T[::-1]
    return packed[:, :-size].reshape(-1, size, size), packed[:, -size:]


def _between(time_s: float, times_s: Array, values: Array) -> Array:
    """Value (m,) at a time on the straight lines between values (T, m) at increasing times (T,), s."""
    after = min(max(int(np.searchsorted(times_s, time_s)), 1), len(times_s) - 1)
    share = (time_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1])
    value: Array = values[after - 1] + share * (values[after] - values[after - 1])
    return value


def finite_horizon_gains(Phi: Array, Gamma: Array, Q: Array, R: Array, terminal: Array) -> Array:
    """Gains of a finite horizon with a constant weight on the way: the discrete form of Ma 2009, eq. (4.12-4.14).

    Args:
        Phi: state transition matrix (6, 6), or of each step (steps, 6, 6).
        Gamma: input matrix (6, 3), or of each step (steps, 6, 3).
        Q: weight (6, 6) of the state at every step but the last.
        R: control weights (steps, 3, 3), from the first step on.
        terminal: weight (6, 6) of the last state.

    Returns:
        Gains (steps, 3, 6), from the first step on.
    """
    return time_varying_gains(Phi, Gamma, np.concatenate([np.tile(Q, (len(R), 1, 1)), terminal[None]]), R)


def time_varying_gains(Phi: Array, Gamma: Array, Q: Array, R: Array) -> Array:
    """Gains (steps, 3, 6) of a finite horizon, see `time_varying_regulator`."""
    return time_varying_regulator(Phi, Gamma, Q, R)[0]


def time_varying_regulator(Phi: Array, Gamma: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Gains and stiffnesses of a finite horizon by the backward Riccati recursion.

    Args:
        Phi: state transition matrix (6, 6), or of each step (steps, 6, 6).
        Gamma: input matrix (6, 3), or of each step (steps, 6, 3).
        Q: state weights (steps + 1, 6, 6), from the first state to the last.
        R: control weights (steps, 3, 3).

    Returns:
        Gains K (steps, 3, 6), from the first step on, and R + Gamma' P Gamma (steps, 3, 3): that times K x is what a
        first bit of control takes off the cost to come, so long as there is none.
    """
    Phis, Gammas = (np.ascontiguousarray(part) for part in per_step(Phi, Gamma, len(R)))
    gains, stiffness = np.zeros((len(R), 3, 6)), np.zeros((len(R), 3, 3))
    _recursion(Phis, Gammas, np.ascontiguousarray(Q, dtype=float), R, gains, stiffness)
    return gains, stiffness


@compiled_loop
def _recursion(Phis: Array, Gammas: Array, Q: Array, R: Array, gains: Array, stiffness: Array) -> None:
    """Fill in gains (steps, 3, 6) and stiffnesses (steps, 3, 3), from the last step to the first."""
    P = Q[-1]
    for step in range(len(R) - 1, -1, -1):
        F, G = Phis[step], Gammas[step]
        PG = P @ G
        stiffness[step] = R[step] + G.T @ PG
        # K = (R + Gamma' P Gamma)^-1 Gamma' P Phi;  P <- Phi' P (Phi - Gamma K) + Q
        gains[step] = np.linalg.solve(stiffness[step], PG.T @ F)
        P = F.T @ P @ (F - G @ gains[step]) + Q[step]
        P = (P + P.T) / 2


def per_step(Phi: Array, Gamma: Array, steps: int) -> tuple[Array, Array]:
    """Both of each step, (steps, 6, 6) and (steps, 6, 3), be they the same for all or not."""
    return np.broadcast_to(Phi, (steps, 6, 6)), np.broadcast_to(Gamma, (steps, 6, 3))


def closed_loop(Phi: Array, Gamma: Array, gains: Array, start: Array) -> tuple[Array, Array]:
    """Follow u = -K x from a start.

    Args:
        Phi: state transition matrix (6, 6), or of each step (steps, 6, 6).
        Gamma: input matrix (6, 3), or of each step (steps, 6, 3).
        gains: (steps, 3, 6).
        start: state (6,).

    Returns:
        States (steps + 1, 6) and controls (steps, 3).
    """
    states, controls = np.zeros((len(gains) + 1, 6)), np.zeros((len(gains), 3))
    Phis, Gammas = per_step(Phi, Gamma, len(gains))
    states[0] = start
    for step, K in enumerate(gains):
        controls[step] = -K @ states[step]
        states[step + 1] = Phis[step] @ states[step] + Gammas[step] @ controls[step]
    return states, controls


def least_fuel_gains(
    Phi: Array, Gamma: Array, R: Array, terminal: Array, start: Array, limit: float, rounds: int, floor: float
) -> Array:
    """Gains of a finite horizon that spend little fuel from a start on: iteratively reweighted least squares.

    The sum of |u| is the limit of sums of w_k |u_k|^2 with w_k = 1 / |u_k| of the round before; it makes most of
    the u_k vanish, so that the path is one of a few burns (Daubechies et al. 2010, doi 10.1002/cpa.20303). A
    control beyond the limit is charged `OVERLOAD` times more; the weights move half of the way (in logarithm),
    which damps oscillations.

    Args:
        Phi: state transition matrix (6, 6), or of each step (steps, 6, 6).
        Gamma: input matrix (6, 3), or of each step (steps, 6, 3).
        R: control weights (steps, 3, 3) of the first round.
        terminal: weight (6, 6) of the last state.
        start: state (6,).
        limit: greatest control of an axis, m/s^2.
        rounds: how often the weights are renewed; 0 gives the least energy.
        floor: added to |u_k| / limit, so that no weight is infinite; thrust in the coasts is cheaper if it is large.

    Returns:
        Gains (steps, 3, 6).

    Raises:
        ConfigError: the last state has no weight.
    """
    check_state_weights(terminal)
    no_cost, weights = np.zeros((6, 6)), np.ones(len(R))
    gains = finite_horizon_gains(Phi, Gamma, no_cost, R, terminal)
    for _ in range(rounds):
        _, controls = closed_loop(Phi, Gamma, gains, start)
        overload = np.maximum(np.abs(controls).max(axis=1) / limit - 1.0, 0.0)
        renewed = (1.0 + OVERLOAD * overload) / (np.linalg.norm(controls, axis=1) / limit + floor)
        weights = np.sqrt(weights * renewed)
        gains = finite_horizon_gains(Phi, Gamma, no_cost, weights[:, None, None] * R, terminal)
    return gains
