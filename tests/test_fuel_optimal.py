"""The fuel optimum: bracketed by linear programs, against closed forms, flown in the environment, beaten by nobody."""

import dataclasses

import numpy as np
import pytest
from oracles import MU, hcw_state_matrix
from scipy import sparse
from scipy.linalg import expm
from scipy.optimize import linprog

from baselines import fuel_optimal, impulsive_transfer, make_policy
from baselines.fuel.certificate import lower_bound
from baselines.fuel.problem import episode_problem
from baselines.transfers import two_impulse
from formation_env import FormationEnv, load_scenario
from formation_env.dynamics import HCW
from formation_env.dynamics.base import Array
from formation_env.evaluation import evaluate, record
from formation_env.orbit import Orbit
from formation_env.scenario import Scenario
from formation_env.schedule import leg_reference, legs

START = np.array([30.0, -40.0, 0.0, 0.02, -0.01, 0.0])
"""Somewhere in the orbit plane: two impulses half a period apart cannot change the place along its normal."""


def vary(name: str, **changes: float | str) -> Scenario:
    """A shipped scenario with other settings, of the scenario or of its spacecraft or reward."""
    scenario = load_scenario(name)
    for key, value in changes.items():
        owner = next(part for part in (scenario, scenario.spacecraft, scenario.reward) if hasattr(part, key))
        changed = dataclasses.replace(owner, **{key: value})
        if owner is scenario:
            scenario = changed
        else:
            field = "spacecraft" if owner is scenario.spacecraft else "reward"
            scenario = dataclasses.replace(scenario, **{field: changed})
    return scenario


def with_phase(scenario: Scenario, **changes: float) -> Scenario:
    """The scenario with other times of its first and only phase."""
    return dataclasses.replace(scenario, phases=(dataclasses.replace(scenario.phases[0], **changes),))


def eccentric() -> Scenario:
    """A closed formation about an eccentric leader, whose linear truth varies from step to step."""
    scenario = dataclasses.replace(load_scenario("keeping_eccentric"), dynamics="yamanaka_ankersen")
    return with_phase(scenario, hold_periods=0.5)


# --- the linear programs


def forced_positions(steps: int, dt_s: float) -> Array:
    """What each thrust does to each later position (steps, 3, steps, 3), by the exponential of a matrix of its own."""
    n = float(np.sqrt(MU / Orbit().radius_m ** 3))
    generator = np.zeros((9, 9))
    generator[:6, :6], generator[3:6, 6:] = hcw_state_matrix(n), np.eye(3)
    effects = np.zeros((steps, 3, steps, 3))
    once, coast = expm(generator * dt_s)[:6, 6:], expm(generator[:6, :6] * dt_s)
    for age in range(steps):
        for k in range(steps - age):
            effects[k + age, :, k] = once[:3]
        once = coast @ once
    return effects


def sphere(count: int) -> Array:
    """Unit vectors (count + 6, 3) all round, the axes among them."""
    i = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1 - 2 * i / count), np.pi * (1 + 5**0.5) * i
    spiral = np.c_[np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)]
    return np.vstack([spiral, np.eye(3), -np.eye(3)])


@dataclasses.dataclass(frozen=True)
class Polyhedral:
    """The problem with lengths of vectors replaced by the greatest of their components along some directions.

    Attributes:
        effects: (3 judged, 3 steps), of the thrust on the judged errors.
        miss: errors without thrust (3 judged,), m.
        price: (judged,), m/s per m.
        dt_s: time step.
        limit: of the thrust of each axis.
    """

    effects: Array
    miss: Array
    price: Array
    dt_s: float
    limit: float

    def cost(self, thrust: Array) -> float:
        """With the true lengths."""
        error = (self.miss + self.effects @ thrust.ravel()).reshape(-1, 3)
        return float(self.dt_s * np.linalg.norm(thrust, axis=1).sum() + self.price @ np.linalg.norm(error, axis=1))

    def outer(self, thrust_cuts: Array, error_cuts: Array) -> tuple[float, Array]:
        """Least cost if |v| is the greatest d.v of the cuts (vectors, directions, 3): a lower bound, and its thrust."""
        steps, judged = len(thrust_cuts), len(error_cuts)
        each = thrust_cuts.shape[1]

        def lengths(count: int) -> sparse.csr_array:
            return sparse.kron(sparse.eye_array(count), np.ones((each, 1)), format="csr")

        along_thrust, along_error = sparse.block_diag(list(thrust_cuts)), sparse.block_diag(list(error_cuts))
        rows = sparse.block_array(
            [
                [along_thrust, -lengths(steps), None],
                [along_error @ sparse.csr_array(self.effects), None, -lengths(judged)],
            ]
        )
        result = linprog(
            np.concatenate([np.zeros(3 * steps), np.full(steps, self.dt_s), self.price]),
            A_ub=rows,
            b_ub=np.concatenate([np.zeros(each * steps), -along_error @ self.miss]),
            bounds=[(-self.limit, self.limit)] * (3 * steps) + [(0, None)] * (steps + judged),
            method="highs",
        )
        assert result.success
        return float(result.fun), result.x[: 3 * steps].reshape(-1, 3)

    def inner(self, directions: Array) -> float:
        """Least cost if vectors are made of steps along directions and each step is paid: an upper bound."""
        steps, judged = self.effects.shape[1] // 3, len(self.price)
        thrusts = sparse.kron(sparse.eye_array(steps), directions.T, format="csr")
        errors = sparse.kron(sparse.eye_array(judged), directions.T, format="csr")
        axes = sparse.hstack([thrusts, sparse.csr_array((3 * steps, errors.shape[1]))])
        result = linprog(
            np.concatenate([np.full(thrusts.shape[1], self.dt_s), np.repeat(self.price, len(directions))]),
            A_eq=sparse.hstack([sparse.csr_array(self.effects) @ thrusts, -errors]),
            b_eq=-self.miss,
            A_ub=sparse.vstack([axes, -axes]),
            b_ub=np.full(6 * steps, self.limit),
            method="highs",
        )
        assert result.success
        return float(result.fun)


def polyhedral(scenario: Scenario, seed: int) -> Polyhedral:
    """The oracle's view of an episode: its coasting flight, and a model written out again."""
    leg = legs(scenario)[0]
    coast = record(make_policy("zero", scenario), scenario, seed)[["x_m", "y_m", "z_m"]].to_numpy()
    judged = np.arange(leg.arrival + 1, leg.end + 1)
    miss = coast[judged] - leg_reference(scenario, leg, judged)[:, :3]
    effects = forced_positions(leg.end, scenario.dt_s)[judged - 1].reshape(3 * len(judged), -1)
    price = np.full(len(judged), scenario.reward.error_weight / len(judged))
    return Polyhedral(effects, miss.ravel(), price, scenario.dt_s, scenario.spacecraft.max_accel_m_s2)


def unit(vectors: Array) -> Array:
    """Directions of vectors (..., 3); of none, the first axis."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), np.eye(3)[0])


@pytest.mark.parametrize(("name", "limit"), [("initialization", 0.002), ("initialization", 0.05), ("keeping", 0.002)])
def test_linear_programs_bracket_the_bound(name: str, limit: float) -> None:
    """Cones inside and outside of the true ones, solved by HiGHS: 106 directions are 4 % apart at most.

    Then the outer ones get the directions of the thrusts and errors that it found itself, four times (Kelley 1960):
    what its thrust truly costs, and its value, close in on the optimum to 0.1 %. The smaller limit is at work.
    """
    scenario = with_phase(
        vary(name, dynamics="hcw", dt_s=200.0, max_accel_m_s2=limit, process_noise_m_s2=5e-5), hold_periods=0.3
    )
    plan, program = fuel_optimal(scenario, seed=5), polyhedral(scenario, 5)
    steps, judged, around = scenario.num_steps, len(program.price), sphere(100)
    thrust_cuts, error_cuts = np.tile(around, (steps, 1, 1)), np.tile(around, (judged, 1, 1))
    assert program.cost(plan.controls) == pytest.approx(plan.cost, rel=1e-6)
    assert plan.cost <= program.inner(around) <= 1.04 * plan.cost
    below, thrust = program.outer(thrust_cuts, error_cuts)
    assert 0.96 * plan.cost <= below <= plan.cost
    for _ in range(4):
        error = (program.miss + program.effects @ thrust.ravel()).reshape(-1, 3)
        thrust_cuts = np.concatenate([thrust_cuts, unit(thrust)[:, None]], axis=1)
        error_cuts = np.concatenate([error_cuts, unit(error)[:, None]], axis=1)
        below, thrust = program.outer(thrust_cuts, error_cuts)
    assert below <= plan.cost * (1 + 1e-9)
    assert plan.cost <= program.cost(thrust) * (1 + 1e-9)
    assert program.cost(thrust) - below < 1e-3 * plan.cost
    assert (np.abs(plan.controls).max() > 0.999 * limit) == (name == "initialization" and limit == 0.002)


# --- closed forms


@pytest.mark.parametrize(("periods", "share", "saves"), [(0.5, np.pi, 0), (1.0, 2 / 3, 2e-3), (2.0, 1 / 3, 1e-3)])
def test_impulses_shift_along_track_as_hill_has_it(periods: float, share: float, saves: float) -> None:
    """By HCW, eq. (3.2-3.3): y0' = -dy / (3 t) after whole periods, x0' = -n dy / 4 after a half; twice, to stop there.

    So delta-v is 2 dy / (3 t) and n dy / 2 = pi dy / p; here times p / dy. What finds it knows nothing of that, and
    proves that no other thrust does better. After whole periods two impulses are not quite the best: burns shortly
    after the start and before the end save a per mille.
    """
    scenario = with_phase(vary("initialization", dynamics="hcw", dt_s=Orbit().period_s / 200), transfer_periods=periods)
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
    scenario = with_phase(scenario, transfer_periods=2910 / period_s, hold_periods=300 / period_s)
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


# --- in the environment


@pytest.mark.parametrize(
    "scenario",
    [
        load_scenario("initialization"),
        load_scenario("reconfiguration"),
        load_scenario("keeping"),
        vary("initialization", shape="quadratic", transfer_error_weight=1e-4),
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
        with_phase(load_scenario("keeping"), hold_periods=0.5),
        vary("initialization", shape="quadratic"),
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
    """Weak duality holds for whatever the multipliers are: the certificate need not trust the solver."""
    scenario, rng = vary("initialization", shape=shape), np.random.default_rng(1)
    problem, cost = episode_problem(scenario, 2), fuel_optimal(scenario, seed=2).cost
    for size in np.geomspace(1e-7, 1e-1, 20):
        multipliers = size * rng.normal(size=(scenario.num_steps + 1, 6))
        multipliers += size * np.concatenate([-problem.goal[:, :3], np.zeros_like(multipliers[:, 3:])], axis=1) / 2000
        assert lower_bound(problem, multipliers) <= cost


def test_less_noise_and_more_thrust_never_cost_more() -> None:
    """A greater set of thrusts has a smaller least cost; so does a smaller price. To the gap of 1e-6 m/s."""
    costs = [fuel_optimal(vary("reconfiguration", max_accel_m_s2=limit), seed=1).cost for limit in (0.005, 0.01, 0.1)]
    assert (np.diff(costs) < 1e-6).all()
    assert costs[0] > 1.01 * costs[2]
    costs = [fuel_optimal(vary("keeping", error_weight=price), seed=1).cost for price in (0.001, 0.01, 0.1)]
    assert (np.diff(costs) > 0).all()


# --- refusals


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
    with pytest.raises(ValueError, match="exact_arrival: the scenario has no phase with transfer_periods > 0"):
        fuel_optimal("keeping", exact_arrival=True)
    with pytest.raises(ValueError, match=r"exact_arrival: no thrust of at most 0\.0001 m/s\^2 .* the steps \[97\]"):
        fuel_optimal(vary("initialization", max_accel_m_s2=1e-4), exact_arrival=True)
    with pytest.raises(ValueError, match="phase: must have transfer_periods > 0, phase 0 has none"):
        impulsive_transfer("keeping")
    with pytest.raises(ValueError, match="phase: must be between 0 and 1, got 2"):
        impulsive_transfer("mission", phase=2)
    with pytest.raises(ValueError, match="instants: must be at least 2, got 1"):
        impulsive_transfer("initialization", instants=1)
