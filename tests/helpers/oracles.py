"""What tests compare against: the equations written out again, apart from the code under test."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

MU, R_EARTH, J2 = 3.986004391e14, 6378136.6, 1.08263e-3


def hcw_state_matrix(n: float) -> Array:
    """x'' = 2 n y' + 3 n^2 x, y'' = -2 n x', z'' = -n^2 z, as x' = A x."""
    return np.array(
        [
            [0, 0, 0, 1, 0, 0],
            [0, 0, 0, 0, 1, 0],
            [0, 0, 0, 0, 0, 1],
            [3 * n**2, 0, 0, 0, 2 * n, 0],
            [0, 0, 0, -2 * n, 0, 0],
            [0, 0, -(n**2), 0, 0, 0],
        ]
    )


def without_units(matrix: Array, n: float) -> Array:
    """A transition matrix (..., 6, 6) with velocities in units of n m, so that its elements are of order one."""
    scale = np.array([1, 1, 1, n, n, n])
    return matrix * scale / scale[:, None]


def random_covariance(rng: np.random.Generator, size: int) -> Array:
    """A well-conditioned symmetric positive definite matrix (size, size)."""
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


def regulator_cost(Phi: Array, Gamma: Array, Q: Array, R: Array) -> Array:
    """Cost-to-go (m, m) of the infinite horizon, by doubling (Chu, Fan, Lin & Wang 2004): matrix inverses only.

    scipy's solver reorders eigenvalues, which in SI units fails under some processors' BLAS.

    Args:
        Phi: transition matrix (m, m).
        Gamma: input matrix (m, k).
        Q: state weight (m, m).
        R: control weight (k, k).
    """
    A, G, H = Phi, Gamma @ np.linalg.solve(R, Gamma.T), Q
    for _ in range(60):
        W = np.eye(len(A)) + G @ H
        inverse_A, inverse_G = np.linalg.solve(W, A), np.linalg.solve(W, G)
        step = A.T @ H @ inverse_A
        A, G, H = A @ inverse_A, G + A @ inverse_G @ A.T, H + step
        G, H = (G + G.T) / 2, (H + H.T) / 2
        if np.abs(step).max() <= 1e-15 * np.abs(H).max():
            return H
    raise AssertionError("the doubling did not converge")


def filter_covariance(Phi: Array, push: Array, H: Array, R_noise: Array) -> Array:
    """Stationary covariance (6, 6) before a measurement; the filter is the regulator's dual (Ma 2009, eq. 4.71).

    Args:
        Phi: transition matrix (6, 6).
        push: effect (6, k) of process noises of 1 sigma over a step.
        H: measurement matrix (m, 6).
        R_noise: covariance (m, m) of the measurement.
    """
    return regulator_cost(Phi.T, H.T, push @ push.T, R_noise)


def fly_under_j2(revolutions: int, inclination_rad: float, radius_m: float) -> tuple[Array, Array]:
    """Integrate a leader, circular at t = 0, in Cartesian ECI with point mass and J2 (Vallado, section 8.6.1).

    Returns:
        Times (T,), s, evenly spaced over whole nodal revolutions, and states (6, T), m and m/s.
    """

    def rates(_: float, state: Array) -> Array:
        position = state[:3]
        r = np.linalg.norm(position)
        q = 1.5 * J2 * (R_EARTH / r) ** 2
        factors = 1 + q * (np.array([1, 1, 3]) - 5 * (position[2] / r) ** 2)
        return np.concatenate([state[3:], -MU / r**3 * position * factors])

    def height_above_equator(_: float, state: Array) -> float:
        return state[2]

    height_above_equator.direction = 1  # type: ignore[attr-defined]
    speed = np.sqrt(MU / radius_m)
    start = [radius_m, 0, 0, 0, speed * np.cos(inclination_rad), speed * np.sin(inclination_rad)]
    end_s = (revolutions + 0.5) * 2 * np.pi * radius_m / speed
    flight = solve_ivp(
        rates, (0, end_s), start, "DOP853", dense_output=True, events=height_above_equator, rtol=1e-11, atol=1e-5
    )
    nodes = flight.t_events[0]
    times = np.linspace(nodes[0], nodes[revolutions], 200 * revolutions)
    return times, flight.sol(times)
