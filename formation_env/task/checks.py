"""Checks of a whole scenario, beyond those of its single fields; each error names the key."""

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from formation_env.dynamics import DYNAMICS, NONLINEAR, check_truth, get_dynamics
from formation_env.dynamics.coasting import check_leader_path
from formation_env.dynamics.nonlinear import substeps
from formation_env.formations import Formation
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.settings import nearest

if TYPE_CHECKING:
    from formation_env.task.scenario import Scenario

MAX_EPISODE_STEPS: Final = 1_000_000
"""Steps of an episode; beyond, even its observations as float32 take 150 MB."""
MAX_TABLE_BYTES: Final = 2_000_000_000
"""Memory that building a scenario's tables may take: half of a small machine's."""
LINEAR_BYTES_PER_STEP: Final = 1_400
"""Measured peak of the schedule's table, its copies included."""
VARYING_BYTES_PER_STEP: Final = 5_700
"""Measured addition for linear models that vary from step to step, those of truth and filter together."""
NONLINEAR_BYTES_PER_SUBSTEP: Final = 3_200
"""Measured addition for the leader's path, per integration step."""


def check_scenario(scenario: "Scenario") -> None:
    """Refuse unknown models, times that do not fit the step, and an impossible start.

    Raises:
        ValueError: one line that names the key and the value.
    """
    _check_models(scenario)
    _check_spacecraft(scenario)
    _check_durations(scenario)
    check_memory(scenario, 1, "dt_s")
    _check_start(scenario)
    if scenario.dynamics == NONLINEAR:
        check_leader_path(scenario.world, scenario.leader, scenario.num_steps * scenario.dt_s)
    scenario.dropout.chain(scenario.dt_s, scenario.orbit)


def check_memory(scenario: "Scenario", variants: int, key: str) -> None:
    """Refuse tables larger than MAX_TABLE_BYTES.

    Args:
        scenario: one variant.
        variants: number of variants, taken as equally long.
        key: setting to name in the error.

    Raises:
        ValueError: naming the key, the size and the limit.
    """
    per_step = LINEAR_BYTES_PER_STEP
    varying = {scenario.dynamics, scenario.filter_model.dynamics} - {NONLINEAR}
    if not all(get_dynamics(name).time_invariant for name in varying):
        per_step += VARYING_BYTES_PER_STEP
    if scenario.dynamics == NONLINEAR:
        per_step += NONLINEAR_BYTES_PER_SUBSTEP * substeps(scenario.dt_s)
    steps = scenario.num_steps * variants
    if steps * per_step > MAX_TABLE_BYTES:
        raise ValueError(
            f"{key}: tables of {steps} steps in all take about {steps * per_step / 1e9:.3g} GB; at most "
            f"{MAX_TABLE_BYTES / 1e9:g} GB, {MAX_TABLE_BYTES // per_step} steps of this scenario"
        )


def _check_models(scenario: "Scenario") -> None:
    """Refuse unknown models, and a truth that would leave out what other settings ask for."""
    for key, name, known in (
        ("dynamics", scenario.dynamics, [*DYNAMICS, NONLINEAR]),
        ("filter.dynamics", scenario.filter.dynamics, [*DYNAMICS]),
    ):
        if name is not None and name not in known:
            raise ValueError(f"{key}: no dynamics model named {name[:80]!r}; {nearest(name, known)}")
    check_truth(scenario.dynamics, scenario.orbit, scenario.perturbations)


def _check_spacecraft(scenario: "Scenario") -> None:
    """Refuse a thruster that never fires, and two spacecraft in different air."""
    least, greatest = scenario.spacecraft.min_accel_m_s2, math.sqrt(3) * scenario.spacecraft.max_accel_m_s2
    if least > greatest:
        raise ValueError(
            f"spacecraft.min_accel_m_s2: must not be above the greatest thrust, {greatest:.4g}, got {least:g}"
        )
    density, leaders = scenario.spacecraft.air_density_kg_m3, scenario.leader.air_density_kg_m3
    if leaders != density:
        raise ValueError(f"leader_spacecraft.air_density_kg_m3: must be the follower's, {density:g}, got {leaders:g}")


def _check_durations(scenario: "Scenario") -> None:
    """Refuse too many steps, and phases shorter than a step."""
    if not scenario.phases:
        raise ValueError("phases: must have at least one phase, got []")
    periods = sum(phase.transfer_orbits + phase.hold_orbits for phase in scenario.phases)
    steps = periods * scenario.orbit.period_s / scenario.dt_s
    if steps > MAX_EPISODE_STEPS:
        raise ValueError(f"dt_s: {steps:.7g} steps of {scenario.dt_s:g} s; an episode has at most {MAX_EPISODE_STEPS}")
    for index, phase in enumerate(scenario.phases):
        for key, periods in (("transfer_orbits", phase.transfer_orbits), ("hold_orbits", phase.hold_orbits)):
            if periods > 0 and scenario.steps(periods) == 0:
                seconds = periods * scenario.orbit.period_s
                raise ValueError(
                    f"phases.{index}.{key}: {periods:g} periods are {seconds:.4g} s, which rounds to no step of "
                    f"dt_s = {scenario.dt_s:g} s"
                )


def _check_start(scenario: "Scenario") -> None:
    """Refuse a nominal start, or a change of phase, that would end the episode at once."""
    limits = scenario.limits
    place = _state(scenario.start.formation, scenario.orbit, "start.formation")[:3]
    range_m = math.hypot(*place)
    if range_m < limits.keep_out_m:
        raise ValueError(
            f"start.formation: {range_m:.6g} m from the leader, inside limits.keep_out_m = {limits.keep_out_m:g} m"
        )
    start_s = 0.0
    for index, phase in enumerate(scenario.phases):
        _state(phase.formation, scenario.orbit, f"phases.{index}.formation")
        arrival_s = start_s + scenario.steps(phase.transfer_orbits) * scenario.dt_s
        end_s = arrival_s + scenario.steps(phase.hold_orbits) * scenario.dt_s
        distance_m = math.dist(place, phase.formation.reference(start_s, scenario.orbit, arrival_s)[:3])
        if distance_m > limits.max_distance_m:
            key = f"phases.{index}.formation" if index else "start.formation"
            raise ValueError(
                f"{key}: {distance_m:.6g} m between the {'phase before' if index else 'start'} and the phase's "
                f"reference, beyond limits.max_distance_m = {limits.max_distance_m:g} m"
            )
        place, start_s = phase.formation.reference(end_s, scenario.orbit, arrival_s)[:3], end_s


def _state(formation: Formation, orbit: Orbit, key: str) -> Array:
    """State (6,) of a formation, which may be defined outside the package."""
    state = np.asarray(formation.state(orbit))
    if state.shape != (6,) or not np.isfinite(state).all():
        raise ValueError(f"{key}: its state must be six finite numbers, got {str(state)[:80]}")
    return state
