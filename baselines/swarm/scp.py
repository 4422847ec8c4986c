"""Centralised sequential convex programming: the near-optimal reference for several followers.

All followers' plans at once are not convex, since they must keep apart. Each follower in turn gets the best plan that
keeps it in half-spaces, away from the others' last paths (Augugliaro, Schoellig & D'Andrea 2012, "Generation of
collision-free trajectories for a quadrocopter fleet: a sequential convex programming approach"), until nothing changes.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from baselines.optimal.cone_program import ConeProgram, ControlProblem, Units
from baselines.optimal.cone_solver import UnreachableError
from baselines.swarm.policy import OwnLaws, SwarmPolicy
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import NonNegative, Positive, settings
from formation_env.task.members import members
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, column, columns, legs

NEAR = 1.6
"""Pairs nearer than this times the distance to be kept have a half-space; the others are looked at again afterwards."""


SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Shares of the distance to be kept, of which the first that a follower can keep is kept in a round."""
MEETING_M = 5.0
"""Two that come nearer than this pass on a side that is chosen."""


@settings
class ScpSettings:
    """Settings of `scp`.

    Attributes:
        law: tracks the plan, in `baselines.POLICIES`.
        margin_m: added to `safety.min_distance_m`, for what noise does between plan and flight.
        rounds: over all followers, at most.
        settled_m: paths that change by less than this are settled.
        tolerance: of the solver.
    """

    law: str = "lqr"
    margin_m: NonNegative = 40.0
    rounds: int = 8
    settled_m: Positive = 1.0
    tolerance: Positive = 1e-6


@dataclass(frozen=True)
class GroupPlan:
    """A plan of a group.

    Attributes:
        states: at each instant (followers, steps + 1, 6), m and m/s.
        controls: in each step (followers, steps, 3), m/s^2.
        least_distance_m: between any two followers, and to the leader, at instants after the start.
    """

    states: Array
    controls: Array
    least_distance_m: float


def plan_group(scenario: Scenario, starts: Array, slots: Array, own: ScpSettings | None = None) -> GroupPlan:
    """Plan a group's whole episode.

    Args:
        scenario: of several followers.
        starts: states (followers, 6) at t = 0, m and m/s.
        slots: who flies where (followers,).
        own: settings.

    Raises:
        UnreachableError: a follower alone cannot be flown within the thrust limit.
        SolverError: the cone solver failed.
    """
    own = own or ScpSettings()
    kept_m = scenario.safety.min_distance_m + own.margin_m
    problems = [_problem(members(scenario)[i][int(slot)]) for i, slot in enumerate(slots)]
    plans = [_solve(problem, start, own) for problem, start in zip(problems, starts, strict=True)]
    for _ in range(own.rounds):
        moved_m = 0.0
        for follower, problem in enumerate(problems):
            others = np.array([plans[i][0][:, :3] for i in range(len(plans)) if i != follower])
            others = np.concatenate([others, np.zeros((1, *others.shape[1:]))])  # the leader
            states, controls = _keep_apart(problem, plans[follower], starts[follower], others, kept_m, own)
            moved_m = max(moved_m, float(np.abs(states[:, :3] - plans[follower][0][:, :3]).max()))
            plans[follower] = states, controls
        if moved_m < own.settled_m:
            break
    paths = np.array([np.vstack([start, states]) for start, (states, _) in zip(starts, plans, strict=True)])
    return GroupPlan(paths, np.array([controls for _, controls in plans]), _least_m(paths[:, 1:, :3]))


def _keep_apart(
    problem: ControlProblem, plan: tuple[Array, Array], start: Array, others: Array, kept_m: float, own: ScpSettings
) -> tuple[Array, Array]:
    """The best plan away from the others' paths, by as much as the follower can: they give way in their turn."""
    for share in SHARES:
        try:
            return _solve(_apart(problem, plan[0][:, :3], others, share * kept_m), start, own)
        except UnreachableError:
            continue
    return plan


def _problem(alone: Scenario) -> ControlProblem:
    """The control problem of one follower's episode, by the filter's model."""
    table, model = build_schedule(alone), alone.filter_dynamics().steps(0, alone.num_steps)
    steps = alone.num_steps
    return ControlProblem(
        F=model.Phi,
        G=model.Gamma,
        d=model.delta,
        duration_s=np.full(steps, alone.dt_s),
        limit_m_s2=np.full(steps, alone.spacecraft.max_accel_m_s2),
        place_m=columns(table, "scored_position")[1:],
        error_weight=column(table, "error_weight")[1:],
        cost=alone.reward.cost(),
    )


def _apart(problem: ControlProblem, path: Array, others: Array, kept_m: float) -> ControlProblem:
    """The problem with a half-space at each instant for each of the others (others, steps, 3) that is near the path."""
    between = path - others
    distance = np.linalg.norm(between, axis=-1)
    who, when = np.nonzero(distance < NEAR * kept_m)
    if not len(who):
        return problem
    sides = np.array([_passing(each, kept_m) for each in between])[who, when]
    normals = sides / np.linalg.norm(sides, axis=-1, keepdims=True)
    least_m = kept_m + np.vecdot(normals, others[who, when])
    return replace(problem, kept=tuple(when.tolist()), normals=normals, least_m=least_m)


def _passing(between: Array, kept_m: float) -> Array:
    """Relative positions (steps, 3) moved apart where they are too near, to one side for each encounter.

    Their own directions turn half round while two pass through each other, which no thrust could follow. So each
    encounter is moved along the direction at its closest approach, as far as the distance to be kept needs.
    """
    moved, near = between.copy(), np.flatnonzero(np.linalg.norm(between, axis=-1) < kept_m)
    for encounter in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
        if len(encounter):
            part = between[encounter]
            side = _side(between, int(encounter[np.linalg.norm(part, axis=-1).argmin()]))
            along = part @ side
            across = part - along[:, None] * side
            needed = np.sqrt(np.maximum(kept_m**2 - np.vecdot(across, across), 0.0))
            moved[encounter] = across + np.maximum(along, needed)[:, None] * side
    return moved


def _side(between: Array, at: int) -> Array:
    """Unit vector of a relative position (steps, 3) at an instant; if they meet, one across their relative motion."""
    if np.linalg.norm(between[at]) > MEETING_M:
        side = between[at]
    else:
        course = between[min(at + 1, len(between) - 1)] - between[max(at - 1, 0)]
        side = np.cross(course, np.eye(3)[np.abs(course).argmin()])
    return np.asarray(side / np.linalg.norm(side))


def _solve(problem: ControlProblem, start: Array, own: ScpSettings) -> tuple[Array, Array]:
    """States at the steps' ends (steps, 6) and accelerations (steps, 3)."""
    units = Units(length_m=100.0, speed_m_s=0.1, accel_m_s2=float(problem.limit_m_s2[0]), time_s=problem.duration_s[0])
    plan = ConeProgram(problem, units, tolerance=own.tolerance).solve(start)
    if not plan.solved:
        raise UnreachableError(f"scp: the cone solver ended with status {plan.status}")
    return plan.states, plan.controls


def _least_m(paths: Array) -> float:
    """Least distance between any two of (followers, instants, 3), and to the leader."""
    every = np.concatenate([paths, np.zeros((1, *paths.shape[1:]))])
    rows, columns_ = np.triu_indices(len(every), 1)
    return float(np.linalg.norm(every[rows] - every[columns_], axis=-1).min())


class Scp(SwarmPolicy):
    """Plans all followers of a group at its first observation, then tracks the plan by a law of one follower.

    It sees all observations and keeps the plans: one of each group, renewed when an episode begins.
    """

    name: ClassVar[str] = "scp"

    def __init__(self, scenario: Scenario, settings: ScpSettings | None = None) -> None:
        super().__init__(scenario)
        self.settings = settings or ScpSettings()
        self._laws = OwnLaws(scenario, self.settings.law)
        self._ends = np.array([leg.end for leg in legs(members(scenario)[0][0])])
        self._goals = np.array([build_schedule(each)[0] for each in members(scenario)[0]])
        self._plans: dict[int, GroupPlan] = {}

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (groups, followers, 3), m/s^2."""
        estimates = self.layout.estimate(observation)
        left = np.rint(self.layout.scalar(observation, "time_left") * self.layout.period_s / self.layout.dt_s)
        steps = (self._ends[self.layout.phase(observation)] - left).astype(int)[:, 0]
        planned, thrust = np.empty_like(estimates), np.zeros((*estimates.shape[:-1], 3))
        for group, step in enumerate(steps.tolist()):
            if step == 0 or group not in self._plans:
                slots = self._slots(self.layout.state(observation[group], "reference"))
                self._plans[group] = plan_group(self.scenario, estimates[group], slots, self.settings)
            plan = self._plans[group]
            planned[group] = plan.states[:, step]
            if step < plan.controls.shape[1]:
                thrust[group] = plan.controls[:, step]
        errors = (estimates - planned) / self.layout.state_scale
        tracking = self._laws.acceleration(observation, errors) - self._laws.acceleration(observation, 0 * errors)
        return np.asarray(thrust + tracking)

    def _slots(self, references: Array) -> Array:
        """Who flies where (followers,), by the reference states (followers, 6) at t = 0."""
        first = columns(self._goals, "reference")
        distances = np.linalg.norm(references[:, None, :3] - first[:, :3], axis=-1)
        return np.asarray(distances.argmin(axis=-1))
