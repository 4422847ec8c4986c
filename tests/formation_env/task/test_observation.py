"""The observation: every block anew from the infos, the clock and the plan."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from env_helpers import Array, coast, covariances, mean_motion, path, random_actions, steps_of

from formation_env import FormationVectorEnv, Scenario, load_scenario, propagate
from formation_env.dropout import GilbertElliott
from formation_env.formations import Following
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.task.observation import BLOCKS, BOUND, SIZE, SLICES, observation_layout

ROWS = 5
FLOAT32 = 3e-7
"""Rounding of an element to float32, relative to its scale; decoded sums of two such elements get a few of them."""

SCENARIOS = {
    "mission": load_scenario("mission"),
    "keeping": load_scenario("keeping"),
    "other belief": dataclasses.replace(
        load_scenario("bx1_companion"),
        filter=KalmanFilter(dynamics="hcw"),
        dropout=GilbertElliott(mean_outage_s=300.0, mean_uptime_orbits=0.1),
    ),
}


@dataclasses.dataclass
class Flight:
    """Observations (instants, rows, SIZE) and what the infos tell about them."""

    scenario: Scenario
    seen: Array
    estimates: Array
    measured: Array
    sigmas: Array

    def __getitem__(self, name: str) -> Array:
        """A block's elements."""
        block = self.seen[..., SLICES[name]]
        return block[..., 0] if block.shape[-1] == 1 else block

    @property
    def steps(self) -> Array:
        """Instants flown."""
        return np.arange(len(self.seen))


@pytest.fixture(scope="module", params=SCENARIOS.values(), ids=SCENARIOS.keys())
def flight(request: pytest.FixtureRequest) -> Flight:
    """A batch under a little random thrust, over the whole plan but its last instant (which is the next's first)."""
    scenario: Scenario = request.param
    env = FormationVectorEnv(ROWS, scenario)
    results: list[tuple[Any, ...]] = [env.reset(seed=1)]
    P = [covariances(env)]
    for action in 0.05 * random_actions(1, scenario.num_steps - 1, ROWS):
        results.append(env.step(action))
        P.append(covariances(env))
    variances = np.diagonal(np.array(P), axis1=2, axis2=3).reshape(len(P), ROWS, 2, 3)
    return Flight(
        scenario,
        np.array([result[0] for result in results], float),
        np.array([result[-1]["estimate"] for result in results]),
        np.array([result[-1]["measured"] for result in results]),
        np.sqrt(variances.mean(axis=-1)),
    )


def clock(scenario: Scenario) -> Array:
    """Start, arrival and end step of each phase (phases, 3)."""
    table, end = [], 0
    for phase in scenario.phases:
        arrival = end + steps_of(phase.transfer_orbits, scenario)
        table.append((end, arrival, arrival + steps_of(phase.hold_orbits, scenario)))
        end = table[-1][2]
    return np.array(table)


def in_force(flight: Flight) -> tuple[Array, Array, Array]:
    """Phase, arrival and end steps at each instant."""
    table = clock(flight.scenario)
    phase = np.searchsorted(table[:, 0], flight.steps, side="right") - 1
    return phase, table[phase, 1], table[phase, 2]


def references(flight: Flight, at_arrival: bool = False) -> Array:
    """Reference states (instants, 6) of the phase in force: now, or in transfer those at the arrival."""
    states: list[Array] = []
    for phase, (start, arrival, end) in zip(flight.scenario.phases, clock(flight.scenario), strict=True):
        target = phase.formation.state(flight.scenario.orbit)
        ahead = (start - arrival) * flight.scenario.dt_s
        way = path(coast(target, ahead, flight.scenario), end - start - 1, flight.scenario)
        states += [target] * (arrival - start) + way[arrival - start :] if at_arrival else way
    return np.array(states)


def assert_states(actual: Array, expected: Array, scale: Array) -> None:
    """Agreement within float32, on the scale of each axis and as far as the bounds reach."""
    within = np.abs(expected / scale) < BOUND
    assert within.mean() > 0.9
    np.testing.assert_allclose((actual / scale)[within], (expected / scale)[within], rtol=FLOAT32, atol=10 * FLOAT32)


def test_the_blocks_fill_the_observation() -> None:
    """One table says what each element is."""
    ends = [SLICES[block.name].stop for block in BLOCKS]
    starts = [SLICES[block.name].start for block in BLOCKS]
    assert starts == [0, *ends[:-1]]
    assert ends[-1] == SIZE
    assert all(block.meaning for block in BLOCKS)


def test_error_and_reference_decode_to_the_estimate(flight: Flight) -> None:
    """The layout gives back SI units: the reference of the plan, and with the error the filter's estimate."""
    layout = observation_layout(flight.scenario)
    scale = np.repeat([layout.length_m, layout.length_m * mean_motion(flight.scenario)], 3)
    reference = np.repeat(references(flight)[:, None], ROWS, axis=1)
    assert_states(layout.state(flight.seen, "reference"), reference, scale)
    assert_states(layout.state(flight.seen, "error"), flight.estimates - reference, scale)
    near = np.abs((flight.estimates - reference) / scale) < BOUND
    decoded = layout.estimate(flight.seen)
    np.testing.assert_allclose((decoded / scale)[near], (flight.estimates / scale)[near], atol=20 * FLOAT32, rtol=1e-6)


def test_arrival_error_is_where_the_estimate_coasts_to(flight: Flight) -> None:
    """By the filter's model, to the time of arrival; in hold it is the error now."""
    scenario, layout = flight.scenario, observation_layout(flight.scenario)
    _, arrival, _ = in_force(flight)
    ahead = np.maximum(arrival - flight.steps, 0)
    goal = references(flight, at_arrival=True)
    scale = np.repeat([layout.length_m, layout.length_m * mean_motion(scenario)], 3)
    for k in flight.steps[:: max(1, len(flight.steps) // 40)]:
        there = propagate(
            flight.estimates[k],
            [ahead[k] * scenario.dt_s],
            dynamics=scenario.filter.dynamics or scenario.dynamics,
            orbit=scenario.orbit,
            spacecraft=scenario.spacecraft,
            leader_spacecraft=scenario.leader,
        )[:, 0]
        assert_states(layout.state(flight.seen[k], "zero_effort_miss"), there - goal[k], scale)
    held = flight.steps >= arrival
    np.testing.assert_array_equal(flight["zero_effort_miss"][held], flight["error"][held])


def test_compressed_errors_are_the_logarithm_of_the_errors(flight: Flight) -> None:
    """sign(e) log(1 + |e| / unit) / log(1 + 1e4), in m and mm/s; what one mm is worth in the linear block bounds it."""
    layout, units = observation_layout(flight.scenario), np.repeat([1, 1e-3], 3)
    for name in ("error", "zero_effort_miss"):
        error = layout.state(flight.seen, name) / units
        within = np.abs(flight[name]) < BOUND
        slack = 10 * FLOAT32 * (layout.state_scale / units * np.maximum(np.abs(flight[name]), 1))
        for shifted in (error - slack, error + slack):
            expected = np.sign(shifted) * np.log1p(np.abs(shifted)) / np.log1p(1e4)
            order = np.sign(expected - flight[name + "_log"]) * np.sign(shifted - error)
            assert (order[within] >= -FLOAT32).all() or np.allclose(
                expected[within], flight[name + "_log"][within], atol=1e-6
            )


def test_the_clock(flight: Flight) -> None:
    """Time to arrival, hold, phase and time left, in the units of the table."""
    phase, arrival, end = in_force(flight)
    step_in_periods = flight.scenario.dt_s * mean_motion(flight.scenario) / (2 * np.pi)
    expected = {
        "time_to_arrival": np.maximum(arrival - flight.steps, 0) * step_in_periods,
        "in_hold": flight.steps >= arrival,
        "phase": phase / len(flight.scenario.phases),
        "time_left": (end - flight.steps) * step_in_periods,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(flight[name], np.tile(values[:, None], ROWS), rtol=FLOAT32, atol=FLOAT32)
    layout = observation_layout(flight.scenario)
    np.testing.assert_array_equal(layout.phase(flight.seen), np.tile(phase[:, None], ROWS))
    seconds = np.maximum(arrival - flight.steps, 0) * flight.scenario.dt_s
    np.testing.assert_allclose(layout.time_to_arrival_s(flight.seen), np.tile(seconds[:, None], ROWS), rtol=1e-6)


def test_sigmas_are_those_of_the_filter(flight: Flight) -> None:
    """log10 of the root mean square over the axes, in m and mm/s, over three decades; the kernel's log has 2e-10."""
    np.testing.assert_allclose(flight["sigma_pos"], np.log10(flight.sigmas[..., 0]) / 3, rtol=FLOAT32, atol=FLOAT32)
    np.testing.assert_allclose(flight["sigma_vel"], np.log10(flight.sigmas[..., 1] / 1e-3) / 3, rtol=1e-6, atol=FLOAT32)


def test_the_link_is_seen_and_how_long_it_is_down(flight: Flight) -> None:
    """The flag is the info's; the age counts from the last measurement, or from the start."""
    age = np.zeros(flight.measured.shape)
    for k in flight.steps[1:]:
        age[k] = np.where(flight.measured[k], 0, age[k - 1] + 1)
    steps_per_period = 2 * np.pi / mean_motion(flight.scenario) / flight.scenario.dt_s
    np.testing.assert_array_equal(flight["measured"], flight.measured)
    np.testing.assert_allclose(flight["measurement_age"], np.log1p(age) / np.log1p(steps_per_period), rtol=1e-6)
    assert age.max() > 3


def test_far_away_the_observation_is_cut_at_its_bounds() -> None:
    """A follower 45 km off is seen where it is, for the limit is 50 km; one that fast at the bound, not beyond it."""
    scenario = load_scenario("initialization")
    hold = dataclasses.replace(scenario.phases[0], formation=Following(y0_m=100.0))
    env = FormationVectorEnv(1, dataclasses.replace(scenario, phases=(hold,)))
    start = [32e3, -32e3, 100, 0, 80, -80]
    observations, infos = env.reset(seed=0, options={"initial_state": start})
    assert (np.abs(infos["estimate"][0, 4:]) > 30 * 1.081e-3 * 50e3 / 30).all()
    error = observations[0, SLICES["error"]]
    np.testing.assert_array_equal(error[4:], [BOUND, -BOUND])
    np.testing.assert_allclose(error[:1], infos["estimate"][0, :1] / (50e3 / 30), rtol=1e-6)
    assert env.observation_space.contains(observations)
