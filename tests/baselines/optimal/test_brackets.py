"""The fuel optimum between linear programs that know nothing of cones, nor of the model's code."""

import dataclasses

import numpy as np
import pytest
from fuel_helpers import vary, with_phase
from oracles import MU, hcw_state_matrix
from scipy import sparse
from scipy.linalg import expm
from scipy.optimize import linprog

from baselines import fuel_optimal, make_policy
from formation_env.evaluation.rollout import record
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs


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

    Then the outer ones get the directions of the thrusts and errors that it found itself, five times (Kelley 1960):
    what its thrust truly costs, and its value, close in on the optimum to 0.1 %. The smaller limit is at work.
    """
    scenario = with_phase(
        vary(name, dynamics="hcw", dt_s=200.0, max_accel_m_s2=limit, process_noise_m_s2=5e-5), hold_orbits=0.3
    )
    plan, program = fuel_optimal(scenario, seed=5), polyhedral(scenario, 5)
    steps, judged, around = scenario.num_steps, len(program.price), sphere(100)
    thrust_cuts, error_cuts = np.tile(around, (steps, 1, 1)), np.tile(around, (judged, 1, 1))
    assert program.cost(plan.controls) == pytest.approx(plan.cost, rel=1e-6)
    assert plan.cost <= program.inner(around) <= 1.04 * plan.cost
    below, thrust = program.outer(thrust_cuts, error_cuts)
    assert 0.96 * plan.cost <= below <= plan.cost
    for _ in range(5):
        error = (program.miss + program.effects @ thrust.ravel()).reshape(-1, 3)
        thrust_cuts = np.concatenate([thrust_cuts, unit(thrust)[:, None]], axis=1)
        error_cuts = np.concatenate([error_cuts, unit(error)[:, None]], axis=1)
        below, thrust = program.outer(thrust_cuts, error_cuts)
    assert below <= plan.cost * (1 + 1e-9)
    assert plan.cost <= program.cost(thrust) * (1 + 1e-9)
    assert program.cost(thrust) - below < 1e-3 * plan.cost
    assert (np.abs(plan.controls).max() > 0.999 * limit) == (name == "initialization" and limit == 0.002)
