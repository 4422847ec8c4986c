"""The plan of an episode, against a construction of its own with matrix exponentials."""

import dataclasses

import numpy as np
import pytest
from env_helpers import Array, coast, mean_motion, plan, steps_of

from formation_env import Scenario, load_scenario, propagate, scenario_names
from formation_env.dropout import Window, Windows
from formation_env.formations import Following, InTrack, Parallel, ProjectedCircle
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.task.observation import observation_layout
from formation_env.task.phases import Limits, Phase
from formation_env.task.scenario import Reward
from formation_env.task.schedule import FIELDS, OFFSETS, build_schedule, leg_reference, legs

COARSE = [name for name in scenario_names() if not name.startswith("thesis")]
CIRCULAR = [load_scenario(name) for name in COARSE if load_scenario(name).orbit.eccentricity == 0]
LONG_M, LONG_M_S = 1e-6, 1e-9
"""Rounding of a path of a few km over hundreds of steps: 1e4 m times 1e-16 per operation, with a wide margin."""


def columns(scenario: Scenario, name: str) -> Array:
    """One quantity of the table, (instants, size)."""
    return build_schedule(scenario)[:, OFFSETS[name] : OFFSETS[name] + FIELDS[name]]


def column(scenario: Scenario, name: str) -> Array:
    return build_schedule(scenario)[:, OFFSETS[name]]


def every_formation() -> Scenario:
    """Transfers to a formation that rests, one that drifts and two that circle, each by a step that does not divide."""
    formations = (Following(y0_m=-700.0), Parallel(x0_m=300.0), ProjectedCircle(vx0_m_s=0.7), InTrack(y0_m=900.0))
    phases = tuple(Phase(formation=f, transfer_orbits=0.3, hold_orbits=0.21) for f in formations)
    return Scenario(phases=phases, dt_s=47.0, reward=Reward(transfer_error_weight=0.003, error_weight=0.02))


@pytest.mark.parametrize("name", COARSE)
def test_the_plan_is_the_clock_in_whole_steps(name: str) -> None:
    """A leg starts where the one before ends, and its times are the nearest whole steps."""
    scenario = load_scenario(name)
    end = 0
    for index, (leg, phase) in enumerate(zip(legs(scenario), scenario.phases, strict=True)):
        assert (leg.index, leg.start) == (index, end)
        assert leg.arrival - leg.start == steps_of(phase.transfer_orbits, scenario)
        assert leg.end - leg.arrival == steps_of(phase.hold_orbits, scenario)
        end = leg.end
    assert end == scenario.num_steps == len(build_schedule(scenario)) - 1


@pytest.mark.parametrize("scenario", [*CIRCULAR, every_formation()])
def test_the_reference_is_the_force_free_path_through_the_formation_at_arrival(scenario: Scenario) -> None:
    """Before the arrival as well as after it: expm(A (t - t_arrival)) times the formation's state there.

    At a leg's end the next leg's reference is in force, except at the episode's.
    """
    reference = columns(scenario, "reference")
    for leg in legs(scenario):
        target = np.asarray(leg.phase.formation.state(scenario.orbit))
        last = leg.end if leg.end == scenario.num_steps else leg.end - 1
        for step in {leg.start, (leg.start + leg.arrival) // 2, leg.arrival, (leg.arrival + last) // 2, last}:
            expected = coast(target, (step - leg.arrival) * scenario.dt_s, scenario)
            np.testing.assert_allclose(reference[step, :3], expected[:3], rtol=1e-9, atol=LONG_M)
            np.testing.assert_allclose(reference[step, 3:], expected[3:], rtol=1e-9, atol=LONG_M_S)
            np.testing.assert_array_equal(leg_reference(scenario, leg, np.array(step)), reference[step])


@pytest.mark.parametrize("scenario", [*CIRCULAR, every_formation()])
def test_each_step_is_judged_by_the_phase_it_belongs_to(scenario: Scenario) -> None:
    """The step that ends a phase is still held against that phase's reference, at that phase's price."""
    expected = plan(scenario)
    reward = scenario.reward
    held = np.array([instant.held for instant in expected])
    price = np.where(held, reward.error_weight, reward.transfer_error_weight) / held.sum()
    price[0] = 0  # no step leads to the start
    positions = [instant.reference[:3] for instant in expected]
    np.testing.assert_allclose(columns(scenario, "scored_position"), positions, rtol=1e-9, atol=LONG_M)
    np.testing.assert_allclose(column(scenario, "error_weight"), price, rtol=1e-12)
    np.testing.assert_array_equal(column(scenario, "counts"), held)


@pytest.mark.parametrize("name", scenario_names())
def test_hold_prices_sum_to_the_error_weight(name: str) -> None:
    """So that the return is -(delta-v + weight * mean error of the hold)."""
    scenario = load_scenario(name)
    assert scenario.reward.transfer_error_weight == 0
    assert column(scenario, "error_weight").sum() == pytest.approx(scenario.reward.error_weight, rel=1e-9)


def test_transfer_prices_are_per_hold_time() -> None:
    """A transfer error costs its weight times dt / T_hold, just like a hold error."""
    scenario = every_formation()
    moving = sum(leg.arrival - leg.start for leg in legs(scenario))
    holding = sum(leg.end - leg.arrival for leg in legs(scenario))
    expected = scenario.reward.error_weight + scenario.reward.transfer_error_weight * moving / holding
    assert column(scenario, "error_weight").sum() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("name", "left"), [("error_weight", "weight_left"), ("counts", "counts_left")])
def test_what_is_left_is_the_sum_of_what_comes_later(name: str, left: str) -> None:
    """An early end is charged for exactly the steps that were not flown."""
    scenario = every_formation()
    values = column(scenario, name)
    expected = [values[k + 1 :].sum() for k in range(len(values))]
    np.testing.assert_allclose(column(scenario, left), expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("dynamics", ["hcw", "modified_hcw"])
@pytest.mark.parametrize("name", ["mission", "bx1_companion"])
def test_the_coast_columns_predict_what_propagation_gives(name: str, dynamics: str) -> None:
    """Matrix times state plus offset is the error at arrival of a follower that only coasts, by the filter's model."""
    scenario = dataclasses.replace(load_scenario(name), filter=KalmanFilter(dynamics=dynamics))
    plane, cross = columns(scenario, "coast_in_plane"), columns(scenario, "coast_cross_track")
    offset = columns(scenario, "coast_offset")
    state = np.array([300.0, -1200.0, 500.0, 0.4, -0.7, 0.2])
    for leg in legs(scenario):
        for step in {leg.start, (leg.start + leg.arrival) // 2, leg.arrival, leg.end - 1}:
            arrival = max(leg.arrival, step)
            there = propagate(
                state,
                [(arrival - step) * scenario.dt_s],
                dynamics=dynamics,
                orbit=scenario.orbit,
                spacecraft=scenario.spacecraft,
                leader_spacecraft=scenario.leader,
            )[0]
            goal = coast(leg.phase.formation.state(scenario.orbit), (arrival - leg.arrival) * scenario.dt_s, scenario)
            error = offset[step].copy()
            error[[0, 1, 3, 4]] += plane[step].reshape(4, 4) @ state[[0, 1, 3, 4]]
            error[[2, 5]] += cross[step].reshape(2, 2) @ state[[2, 5]]
            np.testing.assert_allclose(error[:3], (there - goal)[:3], rtol=1e-8, atol=LONG_M)
            np.testing.assert_allclose(error[3:], (there - goal)[3:], rtol=1e-8, atol=LONG_M_S)


@pytest.mark.parametrize("scenario", [load_scenario("mission"), every_formation()])
def test_the_clock_columns(scenario: Scenario) -> None:
    """Times to the arrival and to the phase's end in periods, the hold's flag, the phase, the arrivals."""
    in_force = np.zeros(scenario.num_steps + 1, int)
    for leg in legs(scenario):
        in_force[leg.start :] = leg.index
    steps = np.arange(scenario.num_steps + 1)
    arrival = np.array([leg.arrival for leg in legs(scenario)])
    end = np.array([leg.end for leg in legs(scenario)])
    step_in_periods = scenario.dt_s * mean_motion(scenario) / (2 * np.pi)
    to_arrival = np.maximum(arrival[in_force] - steps, 0) * step_in_periods
    np.testing.assert_array_equal(column(scenario, "phase"), in_force)
    np.testing.assert_array_equal(column(scenario, "in_hold"), steps >= arrival[in_force])
    np.testing.assert_allclose(column(scenario, "time_to_arrival"), to_arrival, rtol=1e-12)
    np.testing.assert_allclose(column(scenario, "time_left"), (end[in_force] - steps) * step_in_periods, rtol=1e-12)
    expected = np.zeros(len(steps))
    expected[arrival] = 1 / len(arrival)
    np.testing.assert_array_equal(column(scenario, "arrives"), expected)


def test_link_column_is_the_dropout_windows() -> None:
    """Half-open windows [start, start + duration) at the instants k dt."""
    windows = Windows(windows=(Window(start_s=0.0, duration_s=90.0), Window(start_s=301.0, duration_s=60.0)))
    scenario = dataclasses.replace(load_scenario("keeping"), dropout=windows)
    closed = np.flatnonzero(column(scenario, "link_closed"))
    np.testing.assert_array_equal(closed, [0, 1, 2, 11, 12])


def test_length_scale_is_the_farthest_place_of_the_plan() -> None:
    """The observation's L: the largest distance from the leader at the start and in the holds, at least 1 km."""
    scenario = load_scenario("reconfiguration")
    held = [np.linalg.norm(i.reference[:3]) for i in plan(scenario) if i.held]
    assert observation_layout(scenario).length_m == pytest.approx(max(5000, *held), rel=1e-6)
    near = Scenario(phases=(Phase(formation=Following(y0_m=30.0), hold_orbits=1.0),))
    assert observation_layout(near).length_m == pytest.approx(50e3 / 30)
    assert observation_layout(dataclasses.replace(near, limits=Limits(max_distance_m=9e3))).length_m == 1000
