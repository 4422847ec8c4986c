"""Least delta-v of a transfer on any time grid: without a thrust limit, burns shrink to impulses.

The dual problem has six unknowns: lambda, the adjoint state at the arrival, with lambda.d greatest as long as the
primer vector's length is nowhere above 1 (Lawden 1963; Neustadt 1964, "Optimization, a moment problem, and nonlinear
programming"). Any thrust u(t) that covers the miss d spends at least that:
lambda.d = integral of p.u <= integral of |u|.

Legend: lambda adjoint state at the arrival, p primer vector, Phi_k transition matrix from an instant to the arrival.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from baselines.optimal.cone_solver import Cones, ConeSolver
from baselines.optimal.problem import start_of
from formation_env.dynamics import DiscreteModel, get_dynamics
from formation_env.numerics.arrays import Array
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

_FINER: Final = 8
"""Instants at which the primer vector is evaluated, per instant at which an impulse is allowed."""
_UNITS: Final = np.repeat([1000.0, 1.0], 3)
"""Units of miss distances and velocities in the program, m and m/s."""


@dataclass(frozen=True)
class ImpulsivePlan:
    """A transfer by impulses.

    Attributes:
        times_s: instants (instants,) at which impulses are allowed, from the transfer's start to its arrival.
        impulses_m_s: (instants, 3), LVLH; few of them are not 0.
        delta_v_m_s: sum of their magnitudes.
        gap: what delta_v_m_s is at most above the least of any thrust at any time, m/s.
    """

    times_s: Array
    impulses_m_s: Array
    delta_v_m_s: float
    gap: float


def impulsive_transfer(
    scenario: str | Path | Scenario, *, phase: int = 0, initial_state: ArrayLike | None = None, instants: int = 500
) -> ImpulsivePlan:
    """The least delta-v of a phase's transfer with no thrust limit and a time grid that does not matter.

    `fuel_optimal` with `exact_arrival` needs more by what the time step and the thrust limit cost.

    Args:
        scenario: a registered id, a scenario's name or path, or a Scenario, with a linear truth.
        phase: index of the phase.
        initial_state: LVLH state (6,) to start at, m and m/s; by default the nominal one.
        instants: at which impulses are allowed, evenly spread and both ends among them.

    Raises:
        ValueError: a nonlinear truth, a phase without transfer, a state of wrong shape, or fewer than 2 instants.
        SolverError: the solver failed, or no impulses at these instants reach the goal.
        ModuleNotFoundError: Clarabel is not installed; it comes with the extra `optimal`.
    """
    scenario = load_scenario(scenario)
    leg = _transfer(scenario, phase)
    if instants < 2:
        raise ValueError(f"instants: must be at least 2, got {instants}")
    start = start_of(scenario, leg, initial_state)
    times_s = scenario.dt_s * np.linspace(leg.start, leg.arrival, instants)
    whole = _to_arrival(scenario, times_s)
    miss = leg_reference(scenario, leg, np.array(leg.arrival)) - (whole.Phi[0] @ start + whole.delta[0])
    adjoint, impulses = _solve(whole.Phi[:, :, 3:], miss)
    delta_v = float(np.linalg.norm(impulses, axis=1).sum())
    between_s = scenario.dt_s * np.linspace(leg.start, leg.arrival, _FINER * (instants - 1) + 1)
    primer = np.linalg.norm(adjoint @ _to_arrival(scenario, between_s).Phi[:, :, 3:], axis=1)
    return ImpulsivePlan(times_s, impulses, delta_v, delta_v - float(adjoint @ miss / max(primer.max(), 1)))


def _transfer(scenario: Scenario, phase: int) -> Leg:
    """The phase on the clock."""
    plan = legs(scenario)
    if not 0 <= phase < len(plan):
        raise ValueError(f"phase: must be between 0 and {len(plan) - 1}, got {phase}")
    if plan[phase].arrival == plan[phase].start:
        raise ValueError(f"phase: must have transfer_orbits > 0, phase {phase} has none")
    return plan[phase]


def _to_arrival(scenario: Scenario, times_s: Array) -> DiscreteModel:
    """The true model from each instant to the last of them."""
    model = get_dynamics(scenario.dynamics)
    return model.discretise(times_s, times_s[-1] - times_s, scenario.orbit, scenario.spacecraft, scenario.leader)


def _solve(effects: Array, miss: Array) -> tuple[Array, Array]:
    """The adjoint state (6,) at the arrival and the impulses (instants, 3), m/s.

    Args:
        effects: of each impulse on the arrival (instants, 6, 3).
        miss: what they must add up to (6,), m and m/s.
    """
    count = len(effects)
    # maximise lambda.d with (1, effect' lambda) in the cone, at each instant; the multipliers are the impulses
    primer = np.zeros((count, 4, 6))
    primer[:, 1:] = -(effects / _UNITS[:, None]).transpose(0, 2, 1)
    A, b = sparse.csc_array(primer.reshape(-1, 6)), np.tile(np.eye(4)[0], count)
    solver = ConeSolver(sparse.csc_array((6, 6)), -miss / _UNITS, A, Cones(zero=0, positive=0, vectors=count))
    solution = solver.solve(b).checked("impulsive_transfer")
    return solution.x / _UNITS, -solution.z.reshape(count, 4)[:, 1:]
