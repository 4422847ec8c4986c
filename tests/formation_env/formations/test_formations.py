"""Formations: the states of Ma 2009, chapter 3, and the paths they stand for."""

import math

import numpy as np
import oracles
import pytest
from oracles import hcw_state_matrix
from scipy.linalg import expm

from formation_env.formations import (
    FORMATIONS,
    AtLeader,
    Following,
    Formation,
    InTrack,
    Listed,
    Parallel,
    ProjectedCircle,
    SpaceCircle,
    Train,
    XYEllipse,
)
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
N = math.sqrt(oracles.MU / 6978136.6**3)
PERIOD_S = 2 * math.pi / N
TIMES = np.linspace(-0.7, 2.0, 28) * PERIOD_S
ROOT_3 = math.sqrt(3)

# Ma 2009, eq. (3.5-3.9) and section 3.1; the digits are the thesis's own where it prints any.
STATES: dict[str, tuple[Formation, list[float]]] = {
    "at_leader": (AtLeader(), [0, 0, 0, 0, 0, 0]),
    "following": (Following(y0_m=-300.0), [0, -300, 0, 0, 0, 0]),
    "parallel": (Parallel(x0_m=1000.0), [1000, 0, 0, 0, -1.5 * N * 1000, 0]),
    "xy_ellipse": (XYEllipse(), [2000, 0, 0, 0, -2 * N * 2000, 0]),
    "in_track": (InTrack(y0_m=5000.0), [0, 5000, 5000 * 7.292115e-5 / N * math.sin(math.pi / 3), 0, 0, 0]),
    "space_circle": (SpaceCircle(), [2000, 0.4 / N, 2000 * ROOT_3, 0.2, -4000 * N, 0.2 * ROOT_3]),
    "projected_circle": (ProjectedCircle(vx0_m_s=1.8), [0, 3.6 / N, 0, 1.8, 0, 3.6]),
    # Formations of several followers give the place of the first.
    "train": (Train(), [0, -1000, 0, 0, 0, 0]),
    "list": (Listed(formations=(Following(y0_m=-300.0),)), [0, -300, 0, 0, 0, 0]),
}
CENTRED = [XYEllipse(vx0_m_s=0.7), SpaceCircle(), ProjectedCircle(), ProjectedCircle(x0_m=-500.0, vx0_m_s=0.3)]


def test_every_formation_is_tested() -> None:
    """The table above covers the registry, and each class answers to its registered name."""
    assert set(STATES) == set(FORMATIONS)
    assert all(type(formation) is FORMATIONS[formation.kind] for formation, _ in STATES.values())


@pytest.mark.parametrize("name", STATES)
def test_state_is_the_one_of_the_thesis(name: str) -> None:
    """The LVLH state at t = 0, by the thesis's table; rounding only."""
    formation, expected = STATES[name]
    np.testing.assert_allclose(formation.state(ORBIT), expected, rtol=1e-13, atol=1e-13)


def test_states_that_the_thesis_prints() -> None:
    """Sections 5.2.2 and 5.2.4 print the start of the two circles, to the digits given here."""
    keeping = SpaceCircle(x0_m=2000.0, vx0_m_s=0.2).state(ORBIT)
    np.testing.assert_allclose(keeping[:3], [2000, 369.3, 3464.1], rtol=0, atol=0.05)
    np.testing.assert_allclose(keeping[3:], [0.2, -4.3, 0.3], rtol=0, atol=0.05)
    goal = ProjectedCircle(x0_m=0.0, vx0_m_s=1.8).state(ORBIT)
    np.testing.assert_allclose(goal, [0, 3324, 0, 1.8, 0, 3.6], rtol=0, atol=0.5)


@pytest.mark.parametrize("name", sorted(set(STATES) - {"parallel"}))
def test_closes_after_one_period(name: str) -> None:
    """No secular drift, as y0' = -2 n x0: the state after T is the state at 0 (rounding of sin 2 pi, times 10 km)."""
    formation, _ = STATES[name]
    np.testing.assert_allclose(formation.reference(PERIOD_S, ORBIT), formation.state(ORBIT), rtol=0, atol=1e-9)


def test_parallel_drifts_along_a_line() -> None:
    """HCW with y0' = -1.5 n x0: x stays, y = -1.5 n x0 t; a higher orbit falls back by 3 pi x0 in one period."""
    path = Parallel(x0_m=1000.0).reference(TIMES, ORBIT)
    np.testing.assert_allclose(path[:, 0], 1000.0, rtol=1e-12)
    np.testing.assert_allclose(path[:, 1], -1.5 * N * 1000 * TIMES, rtol=1e-12, atol=1e-9)
    assert Parallel(x0_m=1000.0).reference(PERIOD_S, ORBIT)[1] == pytest.approx(-3000 * math.pi, rel=1e-12)


@pytest.mark.parametrize("formation", CENTRED)
def test_ellipse_in_the_orbit_plane_is_two_by_one_about_the_leader(formation: Formation) -> None:
    """x^2 + (y/2)^2 = x0^2 + (x0'/n)^2 at all times."""
    path = formation.reference(TIMES, ORBIT)
    x0, _, _, vx0, _, _ = formation.state(ORBIT)
    np.testing.assert_allclose(path[:, 0] ** 2 + path[:, 1] ** 2 / 4, x0**2 + (vx0 / N) ** 2, rtol=1e-12)


def test_space_circle_keeps_its_distance() -> None:
    """With z = sqrt(3) x the distance is 2 sqrt(x0^2 + (x0'/n)^2) at all times."""
    distance = np.linalg.norm(SpaceCircle().reference(TIMES, ORBIT)[:, :3], axis=1)
    np.testing.assert_allclose(distance, 2 * math.hypot(2000, 0.2 / N), rtol=1e-12)


@pytest.mark.parametrize("formation", [ProjectedCircle(), ProjectedCircle(x0_m=700.0, vx0_m_s=-0.4)])
def test_projected_circle_is_a_circle_in_the_horizontal_plane(formation: ProjectedCircle) -> None:
    """With z = 2 x: y^2 + z^2 = 4 (x0^2 + (x0'/n)^2) at all times."""
    path = formation.reference(TIMES, ORBIT)
    radius = 2 * math.hypot(formation.x0_m, formation.vx0_m_s / N)
    np.testing.assert_allclose(np.hypot(path[:, 1], path[:, 2]), radius, rtol=1e-12)


def test_in_track_follows_the_ground_track() -> None:
    """Eq. (3.9): z(t) = y0 (w_E / n) sin i cos nt, at constant x = 0 and y = y0."""
    path = InTrack(y0_m=5000.0).reference(TIMES, ORBIT)
    z = 5000 * 7.292115e-5 / N * math.sin(math.radians(60)) * np.cos(N * TIMES)
    expected = np.column_stack([np.zeros(28), np.full(28, 5000.0), z])
    np.testing.assert_allclose(path[:, :3], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", STATES)
def test_reference_solves_the_hcw_equations(name: str) -> None:
    """reference(t) = exp(A t) state, before t = 0 too; expm and closed form differ by rounding of 10 km over 2 T."""
    formation, state = STATES[name]
    expected = expm(hcw_state_matrix(N) * TIMES[:, None, None]) @ state
    np.testing.assert_allclose(formation.reference(TIMES, ORBIT), expected, rtol=0, atol=1e-7)


def test_reference_has_the_shape_of_its_times() -> None:
    """One instant gives (6,), a grid (2, 3) gives (2, 3, 6)."""
    formation = SpaceCircle()
    grid = formation.reference(TIMES[:6].reshape(2, 3), ORBIT)
    assert grid.shape == (2, 3, 6)
    np.testing.assert_array_equal(grid[1, 2], formation.reference(TIMES[5], ORBIT))
    assert formation.reference(0.0, ORBIT).shape == (6,)
