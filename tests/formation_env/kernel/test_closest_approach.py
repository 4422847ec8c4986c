"""The least distance along a step's arc, and that of a coast over half an orbit, against dense propagation."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from formation_env import FormationEnv, FormationSwarmEnv, load_scenario, propagate
from formation_env.kernel.stages.closest_approach import least_square
from formation_env.kernel.stages.closest_coast import closest_coast
from formation_env.numerics.arrays import Array
from formation_env.numerics.jit import LANES
from formation_env.task.followers import Safety

DENSE = 2001


@numba.njit
def least_distance(r0: Array, v0: Array, r1: Array, v1: Array, dt_s: float) -> float:
    """The kernel's function, for Python."""
    a, b, c, d = (r0[0], r0[1], r0[2]), (v0[0], v0[1], v0[2]), (r1[0], r1[1], r1[2]), (v1[0], v1[1], v1[2])
    return float(np.sqrt(least_square(a, b, c, d, dt_s)))


@numba.njit
def coast(states: NDArray[np.float32], distance: NDArray[np.float32], time: NDArray[np.float32]) -> None:
    """The kernel's function, for Python."""
    closest_coast(states, distance, time, LANES)


def hcw(states: Array, times: Array) -> Array:
    """Positions (times, ..., 3) of coasts from states (..., 6) by the HCW equations' solution, with n = 1."""
    x, y, z, u, v, w = np.moveaxis(states, -1, 0)
    t = times.reshape(-1, *[1] * x.ndim)
    s, c = np.sin(t), np.cos(t)
    return np.stack(
        [
            (4 - 3 * c) * x + s * u + 2 * (1 - c) * v,
            6 * (s - t) * x + y - 2 * (1 - c) * u + (4 * s - 3 * t) * v,
            c * z + s * w,
        ],
        axis=-1,
    )


def test_the_arc_is_that_of_dense_propagation() -> None:
    """Two coasts that pass each other within a step of 1 % of an orbit.

    The cubic's error at h = 0.06 rad is h^4 / 384 of the distance's fourth derivative, here n^4 times some km: less
    than a millimetre.
    """
    generator, step = np.random.default_rng(0), 0.06
    for _ in range(200):
        middle = np.concatenate([generator.normal(0, 50, 3), generator.normal(0, 2000, 3)])  # m, and m per 1 / n
        start = np.concatenate([hcw(middle, np.array([-step / 2]))[0], velocity(middle, -step / 2)])
        end = np.concatenate([hcw(middle, np.array([step / 2]))[0], velocity(middle, step / 2)])
        dense = np.linalg.norm(hcw(start, np.linspace(0, step, DENSE)), axis=-1).min()
        found = least_distance(start[:3], start[3:], end[:3], end[3:], step)
        assert found == pytest.approx(dense, abs=0.01)
        assert found <= min(np.linalg.norm(start[:3]), np.linalg.norm(end[:3])) + 1e-9


def velocity(state: Array, time: float) -> Array:
    """Velocity of a coast, by central differences of positions that are exact."""
    h = 1e-5
    before, after = hcw(state, np.array([time - h, time + h]))
    return (after - before) / (2 * h)


def test_the_predicted_approach_is_that_of_a_dense_coast() -> None:
    """Relative motions of all kinds: within 1 % of L in distance; a wrong dip of two equal ones is rare."""
    states = np.random.default_rng(1).normal(0, 0.5, (40 * LANES, 6)).astype(np.float32)
    times = np.linspace(0, np.pi, DENSE)
    distances = np.linalg.norm(hcw(states.astype(float), times), axis=-1)
    found, when = np.empty(len(states)), np.empty(len(states))
    for first in range(0, len(states), LANES):
        rows = slice(first, first + LANES)
        distance, time = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
        coast(np.ascontiguousarray(states[rows].T).ravel(), distance, time)
        found[rows], when[rows] = distance, time
    least = distances.min(axis=0)
    assert (found > least - 1e-5).all()  # never nearer than the truth, but for single precision
    assert np.mean(found - least > 0.01) < 0.01
    at = np.abs(times[:, None] / (2 * np.pi) - when).argmin(axis=0)
    np.testing.assert_allclose(distances[at, np.arange(len(states))], found, atol=0.01)


@pytest.mark.parametrize("name", ["swap", "swarm_nonlinear"])
def test_costs_are_those_of_the_true_distances(name: str) -> None:
    """`info["cost"]` and the least distance, from the true states alone; the arcs are short against the distances."""
    scenario = load_scenario(name)
    env = FormationSwarmEnv(scenario)
    _, info = env.reset(seed=1)
    actions, violations = np.random.default_rng(0), 0.0
    before = info["true_state"]
    for _ in range(60):
        _, _, ended, _, info = env.step(actions.uniform(-1, 1, (scenario.followers, 3)).astype(np.float32))
        assert not ended
        after, least = info["true_state"], np.full(scenario.followers, np.inf)
        # the leader is at the origin; positions in between by the cubic, dense
        pairs = [(i, j) for i in range(scenario.followers) for j in range(scenario.followers + 1) if i != j]
        zero = np.zeros((1, 6))
        a, b = np.vstack([before, zero]), np.vstack([after, zero])
        for i, j in pairs:
            least[i] = min(least[i], hermite(a[i] - a[j], b[i] - b[j], scenario.dt_s))
        np.testing.assert_allclose(info["least_distance_m"], least, atol=0.01)
        np.testing.assert_array_equal(info["cost"], least < scenario.safety.min_distance_m)
        violations += info["cost"].sum()
        before = after
    assert violations > 0 or name != "swap"


def hermite(before: Array, after: Array, dt_s: float) -> float:
    """Least distance along the cubic of two end states (6,), dense; scipy's interpolation."""
    from scipy.interpolate import CubicHermiteSpline

    spline = CubicHermiteSpline([0, dt_s], [before[:3], after[:3]], [before[3:], after[3:]])
    return float(np.linalg.norm(spline(np.linspace(0, dt_s, 501)), axis=1).min())


def test_a_pass_between_two_instants_is_noticed() -> None:
    """A follower that crosses the keep-out sphere within one step ends; both instants lie outside."""
    scenario = load_scenario("keeping")
    speed = 10.0
    start = np.array([0.0, 0.45 * speed * scenario.dt_s, 0.0, 0.0, -speed, 0.0])
    limits = replace(scenario.limits, keep_out_m=0.3 * speed * scenario.dt_s)
    env = FormationEnv(replace(scenario, limits=limits, process_noise_m_s2=0.0))
    env.reset(seed=0, options={"initial_state": start})
    _, _, terminated, _, info = env.step(np.zeros(3, np.float32))
    outside = np.linalg.norm(info["true_state"][:3])
    assert outside > limits.keep_out_m
    assert info["least_distance_m"] < limits.keep_out_m
    assert (terminated, info["cost"]) == (True, 1.0)
    times = np.linspace(0, scenario.dt_s, 301)
    path = propagate(start, times, orbit=scenario.orbit, spacecraft=scenario.spacecraft)
    assert info["least_distance_m"] == pytest.approx(np.linalg.norm(path[:, :3], axis=1).min(), abs=0.05)


def test_nothing_costs_where_nothing_is_limited() -> None:
    """`info["cost"]` is 0; the same flight with an error corridor costs in the hold alone."""
    scenario, still = load_scenario("keeping"), np.zeros(3, np.float32)
    free = FormationEnv(scenario)
    free.reset(seed=0)
    infos = [free.step(still)[4] for _ in range(100)]
    assert [info["cost"] for info in infos] == [0.0] * 100
    errors_m = np.array([info["position_error_m"] for info in infos])
    corridor_m = float(np.median(errors_m))
    bound = FormationEnv(replace(scenario, safety=Safety(max_error_m=corridor_m)))
    bound.reset(seed=0)
    np.testing.assert_array_equal([bound.step(still)[4]["cost"] for _ in range(100)], errors_m > corridor_m)
