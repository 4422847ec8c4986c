"""Limits of the models' validity, and whether a scenario stays inside them.

Legend: R radius of the leader's orbit, n its mean motion, rho range to the leader, G_k effect of a constant
acceleration over interval k on the state at the arrival, u_k that acceleration.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from formation_env.dynamics import NONLINEAR, DiscreteModel, get_dynamics
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import Leg, leg_reference, legs

INTERVALS: Final = 60
"""Intervals of constant thrust in a transfer; least accelerations are then within 0.1 % of continuous thrust's."""
AUTHORITY_MARGIN: Final = 1.05
"""Least over available acceleration from which on a transfer counts as impossible; covers the coarse intervals."""
REFERENCE_SAMPLES: Final = 400
"""Instants of a hold at which the range is evaluated; an orbit of two periods is then sampled every 2 degrees."""


class DomainWarning(UserWarning):
    """A scenario asks for what its models cannot describe, or for what no controller can do."""


def curvature_error_m(range_m: float, orbit: Orbit) -> float:
    """Error of the linearised equations at a range, m: rho^2 / (2 R), the term that they neglect.

    A follower on the leader's circle, an arc s ahead, is at x = R (cos(s / R) - 1) = -s^2 / (2 R) + O(s^4 / R^3); the
    linear equations place it at x = 0.
    """
    return range_m**2 / (2 * orbit.radius_m)


def valid_range_m(tolerance_m: float, orbit: Orbit) -> float:
    """Range at which the curvature error reaches a tolerance, m."""
    return float(np.sqrt(2 * orbit.radius_m * tolerance_m))


def warnings_of(scenario: Scenario) -> list[str]:
    """Say what a scenario's models cannot describe, or what makes it a poor task, and what to use instead."""
    return [*beyond_the_model(scenario), *_poor_task(scenario)]


@lru_cache(maxsize=64)
def beyond_the_model(scenario: Scenario) -> tuple[str, ...]:
    """Say at which range the linear equations fail, and which transfers are beyond the thruster.

    Of several followers each is looked at in a slot of its own.
    """
    if scenario.followers > 1:
        alone = [scenario.follower_alone(follower, follower) for follower in range(scenario.followers)]
        return tuple(dict.fromkeys(sentence for each in alone for sentence in beyond_the_model(each)))
    sentences = []
    range_m = max_range_m(scenario)
    error_m = curvature_error_m(range_m, scenario.orbit)
    if error_m > scenario.tolerance_m:
        limit_km = valid_range_m(scenario.tolerance_m, scenario.orbit) / 1e3
        subject = (
            "formations are force-free only in the linear equations, so that holding this one costs thrust throughout"
            if scenario.dynamics == NONLINEAR
            else f"dynamics {scenario.dynamics} neglects it; dynamics: nonlinear does not"
        )
        sentences.append(
            f"At {range_m / 1e3:.4g} km from the leader the orbit's curvature is {error_m:.3g} m, above tolerance_m = "
            f"{scenario.tolerance_m:g} m: {subject}. Stay within {limit_km:.3g} km, or raise tolerance_m."
        )
    for transfer in _transfers(scenario):
        available = scenario.spacecraft.max_accel_m_s2
        if transfer.least_accel_m_s2(available) > AUTHORITY_MARGIN * available:
            sentences.append(
                f"The transfer of phases.{transfer.index} needs {transfer.least_accel_m_s2():.3g} m/s^2 even at full "
                f"thrust throughout, above spacecraft.max_accel_m_s2 = {available:g}: extend transfer_orbits or raise "
                "the thrust."
            )
    return tuple(sentences)


def _poor_task(scenario: Scenario) -> list[str]:
    """Say why a scenario within the models' validity leaves little to control."""
    sentences, craft = [], scenario.spacecraft
    if scenario.num_steps == 1:
        sentences.append(
            f"The episode is a single step of {scenario.dt_s:g} s: decrease dt_s or extend the phases, so that "
            "there is something to control."
        )
    if craft.min_accel_m_s2 >= craft.max_accel_m_s2:
        sentences.append(
            f"The thruster is on/off (min_accel_m_s2 = {craft.min_accel_m_s2:g}, max_accel_m_s2 = "
            f"{craft.max_accel_m_s2:g}): laws that command small thrust, such as lqr and mpc, hardly ever fire. "
            "Use one with few full burns, or decrease min_accel_m_s2."
        )
    return sentences


def facts_of(scenario: Scenario) -> dict[str, float]:
    """Numbers behind the warnings.

    Returns:
        period_s, num_steps, duration_s of the episode; delta_v_authority_m_s, full thrust along one axis throughout;
        transfer_authority_m_s, the same during transfers; transfer_least_delta_v_m_s, the least sum over LVLH axes by
        the linear model; transfer_least_accel_m_s2, the least acceleration limit that still allows each transfer;
        max_range_m of start and holds; curvature_error_m there; valid_range_m of the linear equations. Of several
        followers, each in a slot of its own, the greatest.
    """
    if scenario.followers > 1:
        alone = [facts_of(scenario.follower_alone(follower, follower)) for follower in range(scenario.followers)]
        return {name: max(facts[name] for facts in alone) for name in alone[0]}
    craft, transfers = scenario.spacecraft, _transfers(scenario)
    range_m = max_range_m(scenario)
    return {
        "period_s": scenario.orbit.period_s,
        "num_steps": scenario.num_steps,
        "duration_s": scenario.num_steps * scenario.dt_s,
        "delta_v_authority_m_s": craft.max_accel_m_s2 * scenario.num_steps * scenario.dt_s,
        "transfer_authority_m_s": craft.max_accel_m_s2 * sum(t.duration_s for t in transfers),
        "transfer_least_delta_v_m_s": sum(t.least_delta_v_m_s() for t in transfers),
        "transfer_least_accel_m_s2": max((t.least_accel_m_s2() for t in transfers), default=0.0),
        "max_range_m": range_m,
        "curvature_error_m": curvature_error_m(range_m, scenario.orbit),
        "valid_range_m": valid_range_m(scenario.tolerance_m, scenario.orbit),
    }


def max_range_m(scenario: Scenario) -> float:
    """Largest distance of the nominal start and of the held references from the leader, m."""
    ranges = [np.linalg.norm(scenario.start.formation.state(scenario.orbit)[:3])]
    for leg in legs(scenario):
        held = np.linspace(leg.arrival, leg.end, min(leg.end - leg.arrival + 1, REFERENCE_SAMPLES))
        ranges.append(np.linalg.norm(leg_reference(scenario, leg, held)[..., :3], axis=-1).max())
    return float(max(ranges))


@dataclass(frozen=True)
class _Transfer:
    """A transfer by the filter's linear model, in units of 1 / n and of the miss without thrust.

    Attributes:
        index: its phase.
        duration_s: its duration, s.
        unit_accel_m_s2: acceleration that the dimensionless 1 stands for, m/s^2.
        effects: [G_1 ... G_N] (6, 3 N).
        miss: state that thrust must add (6,), of norm 1 or 0.
    """

    index: int
    duration_s: float
    unit_accel_m_s2: float
    effects: Array
    miss: Array

    def least_accel_m_s2(self, enough: float = 0.0) -> float:
        """Least limit of each axis's acceleration that allows the transfer, or an upper bound of it below `enough`.

        The limit solves min a subject to sum G_k u_k = miss, |u_k| <= a (a linear program); the controls of least
        energy are one feasible solution.
        """
        peak = np.abs(np.linalg.lstsq(self.effects, self.miss)[0]).max()
        if peak * self.unit_accel_m_s2 <= enough:
            return float(peak * self.unit_accel_m_s2)
        from scipy.optimize import linprog  # slow to import

        size = self.effects.shape[1]
        bound = np.hstack([np.eye(size), -np.ones((size, 1))])
        below, above = bound, np.hstack([-np.eye(size), -np.ones((size, 1))])
        solution = linprog(
            np.append(np.zeros(size), 1.0),
            A_ub=np.vstack([below, above]),
            b_ub=np.zeros(2 * size),
            A_eq=np.hstack([self.effects, np.zeros((6, 1))]),
            b_eq=self.miss,
            bounds=(None, None),
        )
        least = peak if solution.x is None else solution.x[-1]
        return float(least * self.unit_accel_m_s2)

    def least_delta_v_m_s(self) -> float:
        """Least sum of the axes' delta-v without an acceleration limit: min sum |u_k| with sum G_k u_k = miss."""
        from scipy.optimize import linprog  # slow to import

        size = self.effects.shape[1]
        solution = linprog(np.ones(2 * size), A_eq=np.hstack([self.effects, -self.effects]), b_eq=self.miss)
        if solution.x is None:
            return float("nan")
        interval_s = self.duration_s / (size // 3)
        return float(solution.x.sum() * self.unit_accel_m_s2 * interval_s)


def _transfers(scenario: Scenario) -> list[_Transfer]:
    """The transfers of a scenario, each from the reference before it."""
    transfers, before = [], scenario.start.formation.state(scenario.orbit)
    for leg in legs(scenario):
        if leg.arrival > leg.start:
            transfers.append(_transfer(scenario, leg, before))
        before = leg_reference(scenario, leg, leg.end)
    return transfers


def _transfer(scenario: Scenario, leg: Leg, before: Array) -> _Transfer:
    """One transfer from the state `before` (6,) at its start."""
    duration_s = (leg.arrival - leg.start) * scenario.dt_s
    count = min(leg.arrival - leg.start, INTERVALS)
    starts_s = leg.start * scenario.dt_s + duration_s / count * np.arange(count)
    filter_model = scenario.filter_model
    leader = scenario.leader_spacecraft or filter_model.spacecraft
    dynamics = get_dynamics(filter_model.dynamics)
    times_s = 0.0 if dynamics.time_invariant else starts_s
    model = dynamics.discretise(times_s, duration_s / count, filter_model.orbit, filter_model.spacecraft, leader)
    effects, Phi, delta = _to_the_end(model.steps(0, count))
    miss = leg_reference(scenario, leg, leg.arrival) - Phi @ before - delta
    n = scenario.orbit.mean_motion_rad_s
    scale = np.repeat([1.0, 1 / n], 3)
    size_m = float(np.linalg.norm(scale * miss)) or 1.0
    return _Transfer(
        leg.index,
        duration_s,
        n**2 * size_m,
        np.hstack(list(scale[:, None] * effects * n**2)),
        scale * miss / size_m,
    )


def _to_the_end(model: DiscreteModel) -> tuple[Array, Array, Array]:
    """Effects at the end of the inputs (count, 6, 3), of the state before (6, 6), and of the disturbance (6,)."""
    effects, Phi, delta = np.zeros_like(model.Gamma), np.eye(6), np.zeros(6)
    for k in reversed(range(len(effects))):
        effects[k] = Phi @ model.Gamma[k]
        delta += Phi @ model.delta[k]
        Phi = Phi @ model.Phi[k]
    return effects, Phi, delta
