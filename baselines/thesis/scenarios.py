"""Scenarios of the thesis, their variations, and its control laws.

All are made from the shipped `thesis_*` files, which hold the printed settings. Each takes another time step, since 1 s
is slow.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from baselines.controllers.lqr import LQRSettings
from baselines.controllers.lqr_quasi_static import LQRQuasiStaticSettings
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.registry import make_policy, read_settings
from baselines.controllers.weights import Weights
from formation_env.dropout import NoDropout
from formation_env.dropout.windows import Window, Windows
from formation_env.formations import Following, ProjectedCircle
from formation_env.numerics.arrays import Array
from formation_env.task.loading import config_folder, load_scenario
from formation_env.task.phases import Phase
from formation_env.task.scenario import Scenario

ENTRY: Final = ProjectedCircle(x0_m=0.0, vx0_m_s=1.8)
"""Orbit that section 5.2.4 enters at [0, 3324, 0, 1.8, 0, 3.6]."""


def _shipped(name: str, dt_s: float | None) -> Scenario:
    """A shipped scenario, with another step if one is given, s."""
    scenario = load_scenario(name)
    return scenario if dt_s is None else replace(scenario, dt_s=dt_s)


def _one_step(scenario: Scenario) -> float:
    """One step in periods of the orbit."""
    return scenario.dt_s / scenario.orbit.period_s


def initialization(transfer_orbits: float = 0.5, dt_s: float | None = None) -> Scenario:
    """Section 5.2.1: from the leader to 2000 m ahead of it, without noise; it ends a step after the arrival.

    Args:
        transfer_orbits: transfer time, in periods of the orbit.
        dt_s: time step, s; the shipped scenario's if left out.
    """
    scenario = _shipped("thesis_initialization", dt_s)
    phase = replace(scenario.phases[0], transfer_orbits=transfer_orbits, hold_orbits=_one_step(scenario))
    return replace(scenario, phases=(phase,))


def keeping(periods: float = 10.0, dt_s: float | None = None) -> Scenario:
    """Section 5.2.2: keeping the space circle with noise and filter.

    Args:
        periods: keeping time, in periods of the orbit.
        dt_s: time step, s; the shipped scenario's if left out.
    """
    scenario = _shipped("thesis_keeping", dt_s)
    return replace(scenario, phases=(replace(scenario.phases[0], hold_orbits=periods),))


def keeping_failure(
    periods: float = 10.0, start_s: float = 0.0, duration_s: float | None = None, dt_s: float | None = None
) -> Scenario:
    """Section 5.2.2, the communication failure: the same, but no measurement arrives in a window.

    Args:
        periods: keeping time, in periods of the orbit.
        start_s: begin of the failure, s.
        duration_s: how long it lasts, s; the shipped scenario's if left out.
        dt_s: time step, s; the shipped scenario's if left out.
    """
    dropout = _shipped("thesis_keeping_failure", None).dropout
    if duration_s is not None:
        dropout = Windows(windows=(Window(start_s=start_s, duration_s=duration_s),)) if duration_s else NoDropout()
    return replace(keeping(periods, dt_s), dropout=dropout)


def reconfiguration(
    entry: ProjectedCircle = ENTRY, y0_m: float = 5000.0, periods: float = 0.5, dt_s: float | None = None
) -> Scenario:
    """Section 5.2.4: from a place ahead of the leader to the projected circle, the desired path throughout.

    Args:
        entry: the circle; its state is where the desired path begins.
        y0_m: where the follower waits ahead of the leader, m.
        periods: time flown, in periods of the orbit.
        dt_s: time step, s; the shipped scenario's if left out.
    """
    scenario = _shipped("thesis_reconfiguration", dt_s)
    start = replace(scenario.start, formation=Following(y0_m=y0_m))
    return replace(scenario, start=start, phases=(Phase(formation=entry, hold_orbits=periods),))


def with_velocity(scenario: Scenario, velocity_m_s: Sequence[float]) -> Array:
    """Initial state (6,) at the scenario's nominal position with another velocity, for `fly_laws`."""
    place = scenario.start.formation.state(scenario.orbit)
    return np.concatenate([place[:3], velocity_m_s])


def mission(dt_s: float | None = None, entry: ProjectedCircle = ENTRY) -> Scenario:
    """Section 5.2.5: from the leader to the x-y ellipse, then to the projected circle, with noise and filter.

    Each desired path is the formation's own from the start of its phase on, as in section 5.2.4.

    Args:
        dt_s: time step, s; the shipped scenario's if left out.
        entry: the projected circle; its state is where the desired path goes on.
    """
    scenario = _shipped("thesis_mission", dt_s)
    ellipse, circle = (
        replace(phase, transfer_orbits=0.0, hold_orbits=phase.transfer_orbits + phase.hold_orbits)
        for phase in scenario.phases
    )
    return replace(scenario, phases=(ellipse, replace(circle, formation=entry)))


def law(name: str, scenario: Scenario, shipped: str, control_s2: float | None = None) -> AccelerationPolicy:
    """Control law of the thesis with its printed settings.

    Args:
        name: `lqr_quasi_static` (the thesis's LQR), `lqr` (error-state feedback with the same weights) or `smc`.
        scenario: scenario flown.
        shipped: name of a settings file in configs/baselines, such as `thesis_keeping`.
        control_s2: factor a of the control weight R = a I / n^2 in place of the printed one, s^2.
    """
    settings = read_settings(name, config_folder("baselines") / f"{shipped}.yaml")
    return make_policy(name, scenario, settings if control_s2 is None else reweighted(settings, control_s2))


def reweighted(settings: Any, control_s2: float) -> LQRSettings | LQRQuasiStaticSettings:
    """Settings of a regulator with the control weight R = a I / n^2, a in s^2.

    Raises:
        ValueError: settings without a control weight.
    """
    R = Weights(control_s2=(control_s2, control_s2, control_s2)).control_s2
    if isinstance(settings, LQRQuasiStaticSettings):
        return replace(
            settings, hold=replace(settings.hold, control_s2=R), transfer=replace(settings.transfer, control_s2=R)
        )
    if isinstance(settings, LQRSettings):
        weights = replace(settings.transfer.weights, control_s2=R)
        return replace(
            settings, hold=replace(settings.hold, control_s2=R), transfer=replace(settings.transfer, weights=weights)
        )
    raise ValueError(f"reweighted: {type(settings).__name__} has no control weight")
