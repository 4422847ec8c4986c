"""Model predictive control: its plans against a linear programme, its flights against its plans."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

from baselines import make_policy
from baselines.controllers.mpc import MPC, MPCSettings
from baselines.optimal.horizon_blocks import block_ends, horizon_end, shared_error_weights
from formation_env import FormationVectorEnv, load_scenario
from formation_env.dropout import NoDropout
from formation_env.evaluation.rollout import evaluate
from formation_env.navigation.sensor import Sensor
from formation_env.numerics.arrays import Array
from formation_env.task.observation import SIZE, SLICES
from formation_env.task.scenario import Reward, Scenario
from formation_env.task.schedule import leg_reference, legs

EVERY_STEP = MPCSettings(horizon_orbits=9.0, growth=0.0, error_scatter=0.0, thrust_scatter=0.0)


def quiet(name: str, dt_s: float = 120.0, initial_sigma_pos_m: float = 0.0) -> Scenario:
    """A shipped scenario at a coarse step, without noise and losses."""
    scenario = load_scenario(name)
    return dataclasses.replace(
        scenario,
        dt_s=dt_s,
        process_noise_m_s2=0.0,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        dropout=NoDropout(),
        start=dataclasses.replace(scenario.start, initial_sigma_pos_m=initial_sigma_pos_m, initial_sigma_vel_m_s=0.0),
    )


def directions(count: int) -> tuple[Array, float]:
    """Unit vectors (count, 3) spread over the sphere, and the least of |v| that the best of them sees of any v."""
    k = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    unit = np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)
    tries = np.random.default_rng(0).normal(size=(20000, 3))
    seen = (tries @ unit.T).max(axis=1) / np.linalg.norm(tries, axis=1)
    return unit, float(seen.min())


def reach(scenario: Scenario, start: Array) -> tuple[Array, Array, Array]:
    """Positions at the hold's instants less the reference: constant part (T, 3) and effect of all controls (T, 3, 3 N).

    And the delta-v price of them, (m/s) per m. Written out from the scenario's model and plan, phase by phase.
    """
    model, count = scenario.filter_dynamics(), scenario.num_steps
    state, effect = start, np.zeros((6, 3 * count))
    free, pushed = [], []
    (leg,) = legs(scenario)
    for step in range(count):
        state = model.Phi @ state + model.delta
        effect = model.Phi @ effect
        effect[:, 3 * step : 3 * step + 3] += model.Gamma
        if step + 1 > leg.arrival:
            free.append((state - leg_reference(scenario, leg, np.array(step + 1)))[:3])
            pushed.append(effect[:3].copy())
    return np.array(free), np.array(pushed), np.array(scenario.reward.error_weight * scenario.dt_s / scenario.hold_s)


def linear_programme(scenario: Scenario, start: Array, unit: Array) -> float:
    """The least cost, m/s, if each norm is the greatest component along the given directions: at most the true one."""
    free, pushed, price = reach(scenario, start)
    count, held, m = scenario.num_steps, len(free), len(unit)
    limit = scenario.spacecraft.max_accel_m_s2
    # d . u_k - t_k <= 0 and d . (free + pushed u) - s_j <= 0, u in units of the limit, s in 100 m
    thrust = np.hstack(
        [np.kron(np.eye(count), unit), -np.kron(np.eye(count), np.ones((m, 1))), np.zeros((count * m, held))]
    )
    error = np.hstack(
        [
            np.concatenate([unit @ block for block in pushed]) * limit / 100,
            np.zeros((held * m, count)),
            -np.kron(np.eye(held), np.ones((m, 1))),
        ]
    )
    b = np.concatenate([np.zeros(count * m), -(free @ unit.T).ravel() / 100])
    cost = np.concatenate([np.zeros(3 * count), np.full(count, scenario.dt_s * limit), np.full(held, 100 * price)])
    bounds = [(-1, 1)] * (3 * count) + [(0, None)] * (count + held)
    return float(linprog(cost, np.vstack([thrust, error]), b, bounds=bounds).fun)


@pytest.mark.parametrize("name", ["initialization", "keeping"])
def test_a_plan_costs_what_a_linear_programme_brackets(name: str) -> None:
    """Norms along 60 directions are too small by at most what they do not see, so they bracket the cones' optimum."""
    scenario = quiet(name, dt_s=300.0)
    start = scenario.start.formation.state(scenario.orbit) + np.array([60.0, -40.0, 30.0, 0.03, 0.02, -0.05])
    unit, seen = directions(60)
    plan = MPC(scenario, EVERY_STEP).program(0).solve(start)
    least = linear_programme(scenario, start, unit)
    assert plan.solved
    # 1e-5: ten times the solver's gap
    assert least * (1 - 1e-5) <= plan.cost_m_s <= least / seen * (1 + 1e-5)


@pytest.mark.parametrize("shape", ["linear", "quadratic"])
def test_a_plans_cost_is_the_environments(shape: str) -> None:
    """Its thrust, put through the model step by step, costs what the solver says, and reaches the limit but no more."""
    reward = Reward(error_cost=shape, quadratic_scale_m=50.0)  # type: ignore[arg-type]
    weak = dataclasses.replace(load_scenario("initialization").spacecraft, max_accel_m_s2=0.002)
    scenario = dataclasses.replace(quiet("initialization"), reward=reward, spacecraft=weak)
    start = scenario.start.formation.state(scenario.orbit) + np.array([20.0, -10.0, 15.0, 0.02, 0.0, -0.01])
    plan = MPC(scenario, EVERY_STEP).program(0).solve(start)
    free, pushed, price = reach(scenario, start)
    errors = np.linalg.norm(free + pushed @ plan.controls.ravel(), axis=1)
    priced = errors.sum() if shape == "linear" else (errors**2).sum() / 50
    delta_v = scenario.dt_s * np.linalg.norm(plan.controls, axis=1).sum()
    assert plan.cost_m_s == pytest.approx(delta_v + price * priced, rel=1e-4)
    np.testing.assert_allclose(
        plan.states[-1][:3], (free + pushed @ plan.controls.ravel())[-1] + [0, 2000, 0], atol=0.1
    )
    assert np.abs(plan.controls).max() == pytest.approx(0.002, rel=1e-4)


def test_a_flight_without_noise_costs_what_was_planned() -> None:
    """Each plan is the rest of the one before, as long as nothing unforeseen happens: Bellman's principle.

    Blocks of more than a step cost some of it: 2 % are allowed. Nothing is cheaper than the plan, within the gap.
    """
    scenario = quiet("initialization")
    start = scenario.start.formation.state(scenario.orbit)
    planned = MPC(scenario, EVERY_STEP).program(0).solve(start).cost_m_s
    exact = -evaluate(MPC(scenario, EVERY_STEP), scenario, [0])["return"][0]
    coarse = -evaluate(MPC(scenario, MPCSettings()), scenario, [0])["return"][0]
    assert exact == pytest.approx(planned, rel=1e-3)
    assert planned * (1 - 1e-3) < coarse < 1.02 * planned


def test_rows_do_not_see_each_other() -> None:
    """Rows at several instants of a mission, in one batch: each gets what it gets alone, within the solver's gap."""
    scenario = dataclasses.replace(load_scenario("mission"), dt_s=120.0)
    env, policy = FormationVectorEnv(2, scenario), make_policy("mpc", scenario)
    observation, seen = env.reset(seed=0)[0], []
    for step in range(70):
        if step in (0, 30, 69):
            seen.append(observation)
        observation = env.step(np.zeros((2, 3), np.float32))[0]
    rows = np.concatenate(seen)
    alone = np.array([policy.predict(row)[0] for row in rows])
    np.testing.assert_allclose(policy.predict(rows)[0], alone, atol=1e-3)
    assert np.abs(alone).max() > 0.1


def test_a_far_follower_is_thrust_to_the_limit_only() -> None:
    """The errors at the observation's bounds: actions are finite and in [-1, 1], and the limit is used."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=120.0)
    observation = np.zeros((2, SIZE), np.float32)
    observation[:, SLICES["error"]] = [[5.0] * 6, [-5.0] * 6]
    observation[:, SLICES["in_hold"]] = observation[:, SLICES["time_left"]] = 1.0
    actions = make_policy("mpc", scenario).predict(observation)[0]
    assert np.isfinite(actions).all()
    assert 0.999 < np.abs(actions).max() <= 1


def test_expected_scatter_keeps_it_from_answering_noise() -> None:
    """Half an orbit of keeping: with the scatter in its cost it fires at fewer steps, and spends less."""
    keeping = load_scenario("keeping")
    phase = dataclasses.replace(keeping.phases[0], hold_orbits=0.5)
    scenario = dataclasses.replace(keeping, phases=(phase,), dt_s=60.0)
    blind = MPC(scenario, MPCSettings(error_scatter=0.0, thrust_scatter=0.0))
    costs = [
        -evaluate(policy, scenario, range(12))["return"].mean() for policy in (blind, MPC(scenario, MPCSettings()))
    ]
    assert costs[1] < 0.98 * costs[0]


def test_blocks_end_at_arrivals_and_phases() -> None:
    """They grow from the finest to the coarsest, and neither an arrival nor a phase's end lies inside one."""
    plan = legs(load_scenario("mission"))
    nodes = block_ends(plan, 5, plan[-1].end, finest=1, coarsest=6, growth=0.2)
    lengths = np.diff(nodes)
    assert (nodes[0], nodes[-1]) == (5, plan[-1].end)
    assert {plan[0].arrival, plan[0].end, plan[1].arrival} <= set(nodes.tolist())
    assert (lengths.min(), lengths.max()) == (1, 6)
    assert lengths[0] == 1


def test_horizons_count_hold_time() -> None:
    """A transfer on the way comes on top, and the episode's end ends it."""
    first, second = plan = legs(load_scenario("mission"))
    assert horizon_end(plan, 0, 100) == first.arrival + 100
    assert horizon_end(plan, first.end - 40, 100) == second.arrival + 60
    assert horizon_end(plan, second.end - 40, 100) == second.end


def test_shared_weights_are_exact_for_errors_on_a_line() -> None:
    """The sum over the blocks' ends is the sum over all steps if the error is linear in time."""
    rng = np.random.default_rng(0)
    price, judge = rng.random(61), np.where(np.arange(61) <= 30, 0, 1)
    nodes = np.array([10, 11, 13, 18, 25, 30, 31, 37, 45])
    shares = shared_error_weights(price, judge, nodes)
    steps = np.arange(11, 46)
    assert shares.sum() == pytest.approx(price[steps].sum(), rel=1e-12)
    late = steps > 31  # beyond the block that begins with the other phase's instant
    early = (steps > 11) & (steps <= 30)
    for line, part in ((np.clip(nodes, 10, 30) - 11.0, early), (np.maximum(nodes - 31.0, 0), late)):
        over = np.interp(steps, nodes, line)
        moment = (price[steps] * over)[part].sum()
        if part is late:
            assert (shares * line[1:])[nodes[1:] > 31].sum() == pytest.approx(moment, rel=1e-12)
        else:
            assert (shares * line[1:])[nodes[1:] <= 30].sum() == pytest.approx(moment, rel=1e-12)


def test_a_weight_on_the_arrival_makes_it_a_constraint() -> None:
    """An exact penalty: above the multiplier the plan is at the target on arrival, which it passes 100 m off without.

    And where the limit forbids it, there is still a plan, as near as full thrust comes.
    """
    scenario = quiet("initialization")
    (leg,), start = legs(scenario), scenario.start.formation.state(scenario.orbit)
    target = leg_reference(scenario, leg, np.array([leg.arrival]))[0, :3]

    def miss_m(price: float, scenario: Scenario = scenario) -> float:
        plan = MPC(scenario, dataclasses.replace(EVERY_STEP, arrival_weight=price)).program(0).solve(start)
        assert plan.solved
        return float(np.linalg.norm(plan.states[leg.arrival - 1, :3] - target))

    free = miss_m(0.0)
    assert free > 50
    # the solver's gap of 1e-6 of a plan of 1 m/s, at 1 m/s per m
    assert miss_m(1.0) < 1e-3
    weak = dataclasses.replace(scenario, spacecraft=dataclasses.replace(scenario.spacecraft, max_accel_m_s2=2e-4))
    assert 1 < miss_m(1.0, weak) < miss_m(0.0, weak)
