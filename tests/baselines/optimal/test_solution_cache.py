"""Cached solutions of the perfect-information bound: nothing stale or broken passes; cost ratios."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import baselines.optimal.lower_bound
from baselines import OptimalPlan, cost_ratio, fuel_optimal
from baselines.optimal import solution_cache
from baselines.optimal.certificate import least_of_steps
from formation_env import load_scenario
from formation_env.task.scenario import Scenario

pytestmark = pytest.mark.filterwarnings("ignore::formation_env.task.domain.DomainWarning")
"""The transfers here are short, so that they are solved at once; no thrust suffices for them."""


@pytest.fixture
def scenario() -> Scenario:
    """A short flight."""
    base = load_scenario("initialization")
    phase = dataclasses.replace(base.phases[0], transfer_orbits=0.1, hold_orbits=0.05)
    return dataclasses.replace(base, phases=(phase,))


def same(one: OptimalPlan, other: OptimalPlan) -> bool:
    return all(np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in dataclasses.fields(one))


def refuse(*_: object) -> None:
    raise AssertionError("solved anew")


def test_a_kept_plan_is_the_plan(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second call does not solve, and gives the same to the last bit; only the folder asked for is written."""
    monkeypatch.chdir(tmp_path)
    unkept = fuel_optimal(scenario, seed=1)
    assert list(tmp_path.iterdir()) == []
    folder = tmp_path / "deep" / "cache"
    first = fuel_optimal(scenario, seed=1, cache_folder=folder)
    (file,) = folder.iterdir()
    assert file.name.startswith("optimal_seed1_")
    assert list(tmp_path.iterdir()) == [tmp_path / "deep"]
    monkeypatch.setattr(baselines.optimal.lower_bound, "solve_episode", refuse)
    assert same(fuel_optimal(scenario, seed=1, cache_folder=folder), first)
    assert same(unkept, first)


def test_each_episode_has_a_file(scenario: Scenario, tmp_path: Path) -> None:
    """Seed, start, kind of arrival and any setting make another name."""
    other = dataclasses.replace(scenario, spacecraft=dataclasses.replace(scenario.spacecraft, max_accel_m_s2=0.006))
    start = np.array([1.0, 2, 3, 0, 0, 0])
    fuel_optimal(scenario, seed=1, cache_folder=tmp_path)
    fuel_optimal(scenario, seed=2, cache_folder=tmp_path)
    fuel_optimal(other, seed=1, cache_folder=tmp_path)
    fuel_optimal(scenario, cache_folder=tmp_path)
    fuel_optimal(scenario, initial_state=start, cache_folder=tmp_path)
    fuel_optimal(scenario, initial_state=2 * start, cache_folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 6


@pytest.mark.parametrize("fault", ["empty", "text", "cut", "shape", "nan", "keys", "stale"])
def test_a_bad_file_is_solved_anew(scenario: Scenario, tmp_path: Path, fault: str) -> None:
    """Be it broken or another episode's: the plan is right, and the file is mended."""
    plan = fuel_optimal(scenario, seed=1, cache_folder=tmp_path)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    place = solution_cache.solution_entry(tmp_path, scenario, 1, None, False)
    assert place.path == file
    arrays = place.read()
    assert arrays is not None
    controls, multipliers = arrays["controls"], arrays["multipliers"]
    if fault in ("empty", "text", "cut"):
        file.write_bytes({"empty": b"", "text": b"no plan", "cut": whole[: len(whole) // 2]}[fault])
    elif fault == "keys":
        place.write({"controls": controls})
    elif fault == "shape":
        place.write({"controls": controls[1:], "multipliers": multipliers})
    elif fault == "nan":
        place.write({"controls": np.nan * controls, "multipliers": multipliers})
    else:
        place.write({"controls": 0.9 * controls, "multipliers": multipliers})
    assert same(fuel_optimal(scenario, seed=1, cache_folder=tmp_path), plan)
    mended = place.read()
    assert mended is not None
    np.testing.assert_array_equal(mended["controls"], controls)
    assert list(tmp_path.iterdir()) == [file]


def test_least_thrust_of_a_step_is_the_least_on_a_grid() -> None:
    """|u| dt + q.u over the cube, by trying: 41 points along each axis of its surface, where it must lie.

    It grows in proportion along a ray, so the least is at 0 or on the surface. The grid misses by the square of half
    its pitch at most, times the curvature dt / |u| <= dt.
    """
    rng, dt_s = np.random.default_rng(3), 0.7
    axis = np.linspace(-1, 1, 41)
    u = np.stack(np.meshgrid(axis, axis, axis), -1).reshape(-1, 3)
    u = u[np.abs(u).max(axis=1) == 1]
    for q in [*rng.normal(size=(30, 3)), np.array([1.0, 0, 0]), np.array([0.8, 0.8, 0.0]), np.zeros(3)]:
        tried = min(0.0, float((dt_s * np.linalg.norm(u, axis=1) + u @ q).min()))
        assert tried - 1e-3 * dt_s <= float(least_of_steps(q, dt_s)) <= tried + 1e-12


def test_cost_ratio_is_cost_over_bound() -> None:
    """Ratios by hand, Student's t of four of them (quantile 3.182 from tables); equal ratios have no interval."""
    result = cost_ratio([2.0, 3.0, 1.0, 6.0], [1.0, 2.0, 1.0, 2.0])
    np.testing.assert_allclose(result.ratios, [2, 1.5, 1, 3])
    assert result.mean == pytest.approx(1.875)
    half = 3.182 * np.std([2, 1.5, 1, 3], ddof=1) / 2
    assert (result.low, result.high) == pytest.approx((1.875 - half, 1.875 + half), rel=1e-3)
    equal = cost_ratio([2.0, 4.0], [1.0, 2.0])
    assert (equal.mean, equal.low, equal.high) == (2, 2, 2)


def test_cost_ratio_refuses_what_does_not_match() -> None:
    """Shapes and bounds."""
    with pytest.raises(ValueError, match=r"cost_ratio: costs and bounds must have one shape \(seeds,\), got \(2,\)"):
        cost_ratio([1.0, 2.0], [1.0])
    with pytest.raises(ValueError, match="bounds: must be > 0, got 0 in place 1"):
        cost_ratio([1.0, 2.0], [1.0, 0.0])
