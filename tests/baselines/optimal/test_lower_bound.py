"""The fuel optimum against closed forms, flown in the environment, and beaten by nobody."""

import dataclasses

import numpy as np
import pytest
from fuel_helpers import vary, with_phase
from oracles import hcw_state_matrix
from scipy.linalg import expm

from baselines import fuel_optimal, impulsive_transfer, make_policy
from baselines.design.transfers import two_impulse
from baselines.optimal.certificate import lower_bound
from baselines.optimal.lower_bound import solve_episode
from baselines.optimal.problem import episode_problem
from formation_env import FormationEnv, load_scenario
from formation_env.dynamics import HCW
from formation_env.evaluation.rollout import evaluate
from formation_env.orbital.orbit import Orbit
from formation_env.task.domain import DomainWarning
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs

START = np.array([30.0, -40.0, 0.0, 0.02, -0.01, 0.0])
"""Somewhere in the orbit plane: two impulses half a period apart cannot change the place along its normal."""


def eccentric() -> Scenario:
    """A closed formation about an eccentric leader, whose linear truth varies from step to step."""
    scenario = dataclasses.replace(load_scenario("keeping_eccentric"), dynamics="yamanaka_ankersen")
    return with_phase(scenario, hold_orbits=0.5)


@pytest.mark.parametrize(("periods", "share", "saves"), [(0.5, np.pi, 0), (1.0, 2 / 3, 2e-3), (2.0, 1 / 3, 1e-3)])
def test_impulses_shift_along_track_as_hill_has_it(periods: float, share: float, saves: float) -> None:
    """By HCW, eq. (3.2-3.3): y0' = -dy / (3 t) after whole periods, x0' = -n dy / 4 after a half; twice, to stop there.

    So delta-v is 2 dy / (3 t) and n dy / 2 = pi dy / p; here times p / dy. What finds it knows nothing of that, and
    proves that no other thrust does better. After whole periods two impulses are not quite the best: burns shortly
    after the start and before the end save a per mille.
    """
    scenario = with_phase(vary("initialization", dynamics="hcw", dt_s=Orbit().period_s / 200), transfer_orbits=periods)
    plan = impulsive_transfer(scenario)
    expected = share * 2000 / Orbit().period_s
    assert (1 - saves - 1e-6) * expected < plan.delta_v_m_s < (1 - 0.3 * saves + 1e-6) * expected
    assert abs(plan.gap) < 1e-6 * expected
    path, n = np.zeros(6), scenario.orbit.mean_motion_rad_s
    for impulse, coast_s in zip(plan.impulses_m_s, np.append(np.diff(plan.times_s), 0), strict=True):
        path[3:] += impulse
        path = expm(hcw_state_matrix(n) * coast_s) @ path
    np.testing.assert_allclose(path, [0, 2000, 0, 0, 0, 0], atol=1e-3)  # the solver's 1e-9, over hours


def test_a_fine_grid_without_limit_comes_to_the_two_impulses() -> None:
    """Burns of one step spend more in proportion to the step; without it, it is the closed form of the two impulses.

    What is left after the extrapolation is of the second order: (n dt)^2 / 10 is 1e-4 at 30 s.
    """
    scenario = vary("initialization", dynamics="hcw", max_accel_m_s2=1.0)
    period_s = scenario.orbit.period_s
    scenario = with_phase(scenario, transfer_orbits=2910 / period_s, hold_orbits=300 / period_s)
    model = HCW().discretise(0.0, 2910.0, scenario.orbit, scenario.spacecraft, scenario.spacecraft)
    goal = np.array([0, 2000.0, 0, 0, 0, 0])
    impulses = two_impulse(model, 2910.0, scenario.orbit.mean_motion_rad_s, START, goal).delta_v_m_s
    costs = [
        fuel_optimal(dataclasses.replace(scenario, dt_s=dt_s), initial_state=START, exact_arrival=True).cost
        for dt_s in (30.0, 10.0)
    ]
    assert impulses < costs[1] < costs[0] < 1.03 * impulses
    assert costs[1] - (costs[0] - costs[1]) / 2 == pytest.approx(impulses, rel=3e-4)
    assert impulsive_transfer(scenario, initial_state=START).delta_v_m_s == pytest.approx(impulses, rel=1e-6)


def test_the_gap_of_few_instants_covers_what_more_would_save() -> None:
    """Reconfiguration's best has an impulse on the way; where it may not be, the gap tells. Least by 2000 instants.

    The primer vector is looked at eight times as finely, so that the bound is too high by 1e-6 at most here.
    """
    fine = impulsive_transfer("reconfiguration", instants=2000)
    assert abs(fine.gap) < 1e-6
    for instants in (2, 4, 8, 16):
        plan = impulsive_transfer("reconfiguration", instants=instants)
        assert plan.delta_v_m_s > fine.delta_v_m_s
        assert plan.delta_v_m_s - plan.gap < fine.delta_v_m_s * (1 + 1e-6)
    assert impulsive_transfer("reconfiguration", instants=2).gap > 1e-3


def test_exact_arrival_of_initialization_costs_about_one_metre_per_second() -> None:
    """A prototype's 1.1 m/s (two digits); the thesis's straight line costs 4.9 m/s. The plan is at the goal then.

    The impulses' cost is the floor; the solver meets the arrival to 1e-9 of a km.
    """
    scenario = load_scenario("initialization")
    plan, arrival = fuel_optimal(scenario, exact_arrival=True), legs(scenario)[0].arrival
    assert plan.cost == pytest.approx(1.1, rel=0.1)
    assert plan.delta_v_m_s == pytest.approx(plan.cost, rel=1e-6)
    np.testing.assert_allclose(plan.states[arrival], [0, 2000, 0, 0, 0, 0], atol=1e-4)
    assert not np.abs(plan.controls[arrival:]).max() > 1e-7
    assert impulsive_transfer(scenario).delta_v_m_s < plan.cost


def test_exact_arrivals_of_the_mission_are_met() -> None:
    """Both transfers end, and the second begins, on the reference; together they cost more than their impulses."""
    scenario = load_scenario("mission")
    plan, (first, second) = fuel_optimal(scenario, exact_arrival=True), legs(scenario)
    for leg, step in ((first, first.arrival), (first, second.start), (second, second.arrival)):
        np.testing.assert_allclose(plan.states[step], leg_reference(scenario, leg, np.array(step)), atol=1e-4)
    impulses = [impulsive_transfer(scenario, phase=phase).delta_v_m_s for phase in (0, 1)]
    assert sum(impulses) < plan.cost < 1.1 * sum(impulses)


@pytest.mark.parametrize(
    "scenario",
    [
        load_scenario("initialization"),
        load_scenario("reconfiguration"),
        load_scenario("keeping"),
        vary("initialization", error_cost="quadratic", transfer_error_weight=1e-4),
        vary("initialization", thrust_noise=0.2),
        eccentric(),
    ],
    ids=["initialization", "reconfiguration", "keeping", "quadratic", "thrust_noise", "eccentric"],
)
def test_the_plan_costs_in_the_environment_what_it_says(scenario: Scenario) -> None:
    """Flown as actions on its seed: the same states, and minus its cost as the return.

    An action is float32: 6e-8 of a burn of 0.3 m/s, over an hour, is below a millimetre; the price of a millimetre is
    1e-5 m/s at most.
    """
    seed, limit = 11, scenario.spacecraft.max_accel_m_s2
    plan = fuel_optimal(scenario, seed=seed)
    env, total = FormationEnv(scenario), 0.0
    states = [env.reset(seed=seed)[1]["true_state"]]
    reach = episode_problem(scenario, seed).limit[:, None]  # what the thruster gives at full throttle in that step
    for action in plan.controls / reach:
        _, reward, _, truncated, info = env.step(action.astype(np.float32))
        states.append(info["true_state"])
        total += float(reward)
    assert truncated
    np.testing.assert_allclose(np.array(states)[:, :3], plan.states[:, :3], atol=1e-3)
    assert -total == pytest.approx(plan.cost + plan.gap, abs=2e-5)
    assert plan.cost > 0
    assert abs(plan.gap) < 1e-6
    assert (np.abs(plan.controls) <= 1.0000001 * reach).all()
    assert (scenario.spacecraft.thrust_noise == 0) == np.allclose(reach, limit, rtol=1e-6)


@pytest.mark.parametrize(
    "scenario",
    [
        load_scenario("initialization"),
        load_scenario("reconfiguration"),
        with_phase(load_scenario("keeping"), hold_orbits=0.5),
        vary("initialization", error_cost="quadratic"),
        vary("initialization", thrust_noise=0.2, min_accel_m_s2=1e-4),
    ],
    ids=["initialization", "reconfiguration", "keeping", "quadratic", "thruster"],
)
def test_nobody_beats_the_bound(scenario: Scenario) -> None:
    """No policy on its seed, be it good or not."""
    seeds = [0, 1, 2, 3]
    bounds = np.array([fuel_optimal(scenario, seed=seed).cost for seed in seeds])
    for name in ("lqr", "smc", "zero", "random"):
        costs = -evaluate(make_policy(name, scenario), scenario, seeds)["return"].to_numpy()
        assert (costs > bounds).all(), name


def test_nothing_near_the_plan_is_cheaper() -> None:
    """Random changes of the plan, within the limit and of many sizes, flown on its seed as one episode each."""
    scenario, seed, rng = load_scenario("initialization"), 4, np.random.default_rng(0)
    plan, env = fuel_optimal(scenario, seed=seed), FormationEnv(scenario)
    for size in np.geomspace(1e-4, 0.1, 12):
        bursts = rng.normal(size=plan.controls.shape) * (rng.uniform(size=(len(plan.controls), 1)) < 0.05)
        actions = plan.controls / scenario.spacecraft.max_accel_m_s2 + size * bursts
        env.reset(seed=seed)
        total = sum(float(env.step(action.astype(np.float32))[1]) for action in np.clip(actions, -1, 1))
        assert -total > plan.cost


@pytest.mark.parametrize("shape", ["linear", "quadratic"])
def test_any_multipliers_give_a_lower_bound(shape: str) -> None:
    """Weak duality holds for whatever the multipliers are: the certificate need not trust the solver.

    Random ones of many sizes, some towards the goal; and those of a dearer problem, which are too long for this one.
    """
    scenario, rng = vary("initialization", error_cost=shape), np.random.default_rng(1)
    problem, cost = episode_problem(scenario, 2), fuel_optimal(scenario, seed=2).cost
    for size in np.geomspace(1e-7, 1e-1, 20):
        multipliers = size * rng.normal(size=(scenario.num_steps + 1, 6))
        multipliers += size * np.concatenate([-problem.goal[:, :3], np.zeros_like(multipliers[:, 3:])], axis=1) / 2000
        assert lower_bound(problem, multipliers) <= cost
    dearer = episode_problem(vary("initialization", error_cost=shape, error_weight=0.02), 2)
    multipliers = solve_episode(dearer).multipliers
    assert lower_bound(problem, multipliers) <= cost < lower_bound(dearer, multipliers)


def test_more_thrust_and_a_smaller_price_cost_less() -> None:
    """A greater set of thrusts has no greater least cost, nor has a smaller price; to a gap of 1e-6 m/s."""
    costs = [fuel_optimal(vary("reconfiguration", max_accel_m_s2=limit), seed=1).cost for limit in (0.005, 0.01, 0.1)]
    assert (np.diff(costs) < 1e-6).all()
    assert costs[0] > 1.01 * costs[2]
    costs = [fuel_optimal(vary("keeping", error_weight=price), seed=1).cost for price in (0.001, 0.01, 0.1)]
    assert (np.diff(costs) > 0).all()


@pytest.mark.filterwarnings("ignore::formation_env.task.domain.DomainWarning")  # a thrust that cannot suffice is meant
def test_what_has_no_bound_is_refused() -> None:
    """One line each, with the argument's name."""
    with pytest.raises(ValueError, match="dynamics: the fuel optimum needs a linear truth, got 'nonlinear'"):
        fuel_optimal("keeping_nonlinear")
    with pytest.raises(ValueError, match="dynamics: the fuel optimum needs a linear truth"):
        impulsive_transfer("mission_nonlinear")
    with pytest.raises(ValueError, match="initial_state: give it or a seed, not both; got seed = 1"):
        fuel_optimal("keeping", seed=1, initial_state=np.zeros(6))
    with pytest.raises(ValueError, match=r"initial_state: must be finite with shape \(6,\), got shape \(3,\)"):
        fuel_optimal("keeping", initial_state=[1, 2, 3])
    with pytest.raises(ValueError, match="exact_arrival: the scenario has no phase with transfer_orbits > 0"):
        fuel_optimal("keeping", exact_arrival=True)
    with (
        pytest.raises(ValueError, match=r"exact_arrival: no thrust of at most 0\.0001 m/s\^2 .* the steps \[97\]"),
        pytest.warns(DomainWarning, match="needs 0.000713"),
    ):
        fuel_optimal(vary("initialization", max_accel_m_s2=1e-4), exact_arrival=True)
    with pytest.raises(ValueError, match="phase: must have transfer_orbits > 0, phase 0 has none"):
        impulsive_transfer("keeping")
    with pytest.raises(ValueError, match="phase: must be between 0 and 1, got 2"):
        impulsive_transfer("mission", phase=2)
    with pytest.raises(ValueError, match="instants: must be at least 2, got 1"):
        impulsive_transfer("initialization", instants=1)
