"""One cone program with two users, and a solver whose failures are noticed."""

import ast
import dataclasses
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

import baselines
from baselines import fuel_optimal, impulsive_transfer, make_policy
from baselines.controllers.mpc import MPC, MPCSettings
from baselines.optimal.cone_solver import Cones, ConeSolver, SolverError, UnreachableError
from formation_env import load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.task.observation import SIZE, SLICES
from formation_env.task.reward import Reward

EVERY_STEP = MPCSettings(
    horizon_orbits=9.0, growth=0.0, finest_orbits=1e-6, coarsest_orbits=1e-6, error_scatter=0, thrust_scatter=0
)


@pytest.mark.parametrize("error_cost", ["linear", "quadratic"])
def test_bound_and_horizon_agree(error_cost: str) -> None:
    """Over a whole episode in blocks of one step, without scatter, mpc's plan costs what the certified bound says.

    Two phases with errors on the way that count; the filter's model is the truth. 1e-5: ten times mpc's tolerance.
    """
    reward = Reward(error_cost=error_cost, transfer_error_weight=0.002, quadratic_scale_m=60.0)  # type: ignore[arg-type]
    scenario = dataclasses.replace(load_scenario("mission"), dt_s=240.0, reward=reward)
    start = scenario.start.formation.state(scenario.orbit) + np.array([40.0, -30.0, 20.0, 0.02, 0.01, -0.03])
    plan = MPC(scenario, EVERY_STEP).program(0).solve(start)
    assert plan.solved
    assert len(plan.controls) == scenario.num_steps
    assert plan.cost_m_s == pytest.approx(fuel_optimal(scenario, initial_state=start).cost, rel=1e-5)


def test_a_program_is_solved_again_for_another_right_hand_side() -> None:
    """Least x so that x >= |v|: 5 for v = (3, 4, 0); then, with the same solver, 13."""
    A = sparse.csc_array(np.array([[-1.0], [0.0], [0.0], [0.0]]))
    solver = ConeSolver(sparse.csc_array((1, 1)), [1.0], A, Cones(zero=0, positive=0, vectors=1))
    for vector, length in (((3.0, 4.0, 0.0), 5.0), ((5.0, 0.0, 12.0), 13.0)):
        solution = solver.solve([0.0, *vector]).checked("test")
        assert solution.x[0] == pytest.approx(length, rel=1e-8)
        assert solution.cost == pytest.approx(length, rel=1e-8)


def test_what_cannot_be_met_is_told_from_a_failure() -> None:
    """x = 1 and x = 2 at once."""
    solver = ConeSolver(sparse.csc_array((1, 1)), [1.0], sparse.csc_array(np.ones((2, 1))), Cones(2, 0, 0))
    with pytest.raises(UnreachableError):
        solver.solve([1.0, 2.0])


@pytest.fixture
def two_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that gives up early."""
    whole = ConeSolver._settings

    def limited(self: ConeSolver) -> object:
        settings = whole(self)
        settings.max_iter = 2
        return settings

    monkeypatch.setattr(ConeSolver, "_settings", limited)


@pytest.mark.usefixtures("two_iterations")
def test_bounds_refuse_a_solution_that_is_none() -> None:
    """The certificate finds the gap, the transfer by impulses the status."""
    with pytest.raises(SolverError, match="fuel_optimal: the solver left a gap of"):
        fuel_optimal("keeping", seed=1)
    with pytest.raises(SolverError, match="impulsive_transfer: the cone solver ended with status MaxIterations"):
        impulsive_transfer("initialization")


@pytest.mark.usefixtures("two_iterations")
def test_mpc_reports_a_failed_plan_once() -> None:
    """One line with status and step; later ones are counted, and the actions stay finite."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=120.0)
    policy = make_policy("mpc", scenario)
    observation = np.zeros((2, SIZE), np.float32)
    observation[:, SLICES["in_hold"]] = observation[:, SLICES["time_left"]] = 1.0
    with pytest.warns(RuntimeWarning, match=r"mpc: the cone solver ended with status MaxIterations at step \d+; "):
        actions = policy.predict(observation)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        policy.predict(observation)
    assert np.isfinite(actions).all()
    assert policy.failed_plans == 4  # type: ignore[attr-defined]


def test_no_plan_fails_in_a_shipped_scenario() -> None:
    """A warning would be an error here."""
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=240.0)
    policy = make_policy("mpc", scenario)
    evaluate(policy, scenario, [0])
    assert policy.failed_plans == 0  # type: ignore[attr-defined]


def test_without_the_solver_all_users_name_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """One error for all; its name is the missing library's."""
    monkeypatch.setitem(sys.modules, "clarabel", None)
    scenario = dataclasses.replace(load_scenario("keeping"), dt_s=300.0)
    users = (
        lambda: fuel_optimal(scenario),
        lambda: impulsive_transfer("initialization"),
        lambda: MPC(scenario, EVERY_STEP).program(0),
    )
    for user in users:
        with pytest.raises(ModuleNotFoundError, match=r"pip install 'formation-env\[optimal\]'") as error:
            user()
        assert error.value.name == "clarabel"


def test_one_module_imports_the_solver() -> None:
    """Everything else goes through `cone_solver`."""
    users = []
    for path in Path(baselines.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if "clarabel" in [*names, getattr(node, "module", None)]:
                users.append(path.name)
    assert users == ["cone_solver.py"]
