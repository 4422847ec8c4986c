"""Data of the perfect-information optimum: an episode whose start and disturbances are all known.

Legend: Phi, Gamma as in `DiscreteModel`, of each step.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from baselines.design.phase_tables import nominal_start
from formation_env.dynamics import NONLINEAR
from formation_env.envs import FormationEnv
from formation_env.numerics.arrays import Array
from formation_env.task.phases import Limits
from formation_env.task.reward import ErrorCost
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, build_schedule, column, columns, leg_reference, legs

_FAR_M: Final = 1e9
"""A distance limit that no episode reaches."""


@dataclass(frozen=True)
class Problem:
    """Minimise the sum over steps of |u| dt + w (linear |e| + quadratic |e|^2), e being the error at a step's end.

    The thrust u of step k is within +-limit[k] on each axis; the state is free_path plus what the thrust does.

    Attributes:
        dt_s: time step, s.
        Phi: transition matrices (steps, 6, 6).
        Gamma: input matrices (steps, 6, 3).
        free_path: states without thrust (steps + 1, 6), m and m/s; the process noise is in them.
        goal: states (steps + 1, 6) that errors are counted from; the velocity matters at the instants to be met only.
        error_weight: weight w of the error at each instant (steps + 1,), (m/s) per m; 0 at the start.
        cost: cost of an error per unit of its weight.
        limit: greatest thrust acceleration along each axis (steps,), m/s^2.
        met: instants at which the state must be the goal.
    """

    dt_s: float
    Phi: Array
    Gamma: Array
    free_path: Array
    goal: Array
    error_weight: Array
    cost: ErrorCost
    limit: Array
    met: tuple[int, ...]

    @property
    def miss(self) -> Array:
        """Errors (steps + 1, 6) without any thrust."""
        return self.free_path - self.goal


def episode_problem(
    scenario: Scenario, seed: int | None = None, initial_state: ArrayLike | None = None, exact_arrival: bool = False
) -> Problem:
    """The problem of one episode.

    Args:
        scenario: what is flown; its truth must be linear.
        seed: of the episode; its start and all its noises are known then.
        initial_state: LVLH state (6,) to start at without any noise, m and m/s; the nominal start if neither is given.
        exact_arrival: drop the weight of errors; be at the reference at each transfer's two ends instead.

    Raises:
        ValueError: a nonlinear truth, both a seed and a state, a state of wrong shape, or no transfer to arrive from.
    """
    scenario = scenario if seed is None else flown_scenario(scenario, seed)
    start = start_of(scenario, legs(scenario)[0], initial_state)
    if seed is not None and initial_state is not None:
        raise ValueError(f"initial_state: give it or a seed, not both; got seed = {seed}")
    model = scenario.true_dynamics().steps(0, scenario.num_steps)
    if seed is None:
        free_path, thrust_gain = _coast(scenario, start), np.ones(scenario.num_steps)
    else:
        free_path, thrust_gain = _episode(scenario, seed)
    goal, weight = _scores(scenario)
    met = _meet(scenario, goal) if exact_arrival else ()
    return Problem(
        dt_s=scenario.dt_s,
        Phi=model.Phi,
        Gamma=model.Gamma,
        free_path=free_path,
        goal=goal,
        error_weight=0 * weight if exact_arrival else weight,
        cost=scenario.reward.cost(),
        limit=scenario.spacecraft.max_accel_m_s2 * np.abs(thrust_gain),
        met=met,
    )


def flown_scenario(scenario: Scenario, seed: int) -> Scenario:
    """Scenario of a seed's episode: with domain randomization one of the variants."""
    if scenario.domain_randomization is None:
        return scenario
    env = FormationEnv(scenario)
    env.reset(seed=seed)
    return env.simulation.first_row_scenario


def start_of(scenario: Scenario, leg: Leg, initial_state: ArrayLike | None) -> Array:
    """The state (6,) given to start a phase at; the nominal one without it.

    Raises:
        ValueError: a nonlinear truth, or a state of wrong shape or not finite.
    """
    if scenario.dynamics == NONLINEAR:
        raise ValueError(f"dynamics: the fuel optimum needs a linear truth, got {NONLINEAR!r}")
    start = nominal_start(scenario, leg) if initial_state is None else np.asarray(initial_state, float)
    if start.shape != (6,) or not np.isfinite(start).all():
        raise ValueError(f"initial_state: must be finite with shape (6,), got shape {start.shape}: {start}")
    return start


def _coast(scenario: Scenario, start: Array) -> Array:
    """States (steps + 1, 6) without thrust and noise."""
    path = scenario.true_dynamics().steps(0, scenario.num_steps).from_start()
    return np.asarray(path.Phi @ start + path.delta)


def _episode(scenario: Scenario, seed: int) -> tuple[Array, Array]:
    """An episode's states (steps + 1, 6) without thrust, and the gain (steps,) of its thruster in each step.

    The environment draws its noises by seed and step, whatever the actions are: the path of a flight without thrust
    contains the process noise, and its infos give the thruster's error.
    """
    env = FormationEnv(replace(scenario, limits=Limits(max_distance_m=_FAR_M)), analysis=True)
    infos = [env.reset(seed=seed)[1]]
    infos += [env.step(np.zeros(3, np.float32))[4] for _ in range(scenario.num_steps)]
    path = np.array([info["true_state"] for info in infos])
    return path, 1 + np.array([info["thrust_noise"] for info in infos[1:]])


def _scores(scenario: Scenario) -> tuple[Array, Array]:
    """Scored state (steps + 1, 6), of which only the position counts, and error weight (steps + 1,) of each instant."""
    table = build_schedule(scenario)
    goal = np.zeros((len(table), 6))
    goal[:, :3] = columns(table, "scored_position")
    return goal, column(table, "error_weight").copy()


def _meet(scenario: Scenario, goal: Array) -> tuple[int, ...]:
    """The instants at which transfers end, and begin after a hold; their reference states (6,) are put into `goal`."""
    transfers = [leg for leg in legs(scenario) if leg.arrival > leg.start]
    if not transfers:
        raise ValueError("exact_arrival: the scenario has no phase with transfer_orbits > 0 to arrive from")
    plan, met = legs(scenario), []
    for leg in transfers:
        if leg.index > 0:
            goal[leg.start] = leg_reference(scenario, plan[leg.index - 1], np.array(leg.start))
            met.append(leg.start)
        goal[leg.arrival] = leg_reference(scenario, leg, np.array(leg.arrival))
        met.append(leg.arrival)
    return tuple(met)
