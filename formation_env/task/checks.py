"""Checks of a scenario's parts against each other. Each raises a ValueError of one line that names key and value."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from formation_env.dynamics import DYNAMICS, NONLINEAR, check_truth, get_dynamics
from formation_env.dynamics.nonlinear import substeps
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.formations import Formation
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit
from formation_env.settings import nearest
from formation_env.task.followers import FollowerSettings, Safety
from formation_env.task.phases import Limits, Phase, Start, whole_steps

MAX_EPISODE_STEPS: Final = 1_000_000
"""Steps of an episode; beyond, even its observations as float32 take 150 MB."""
SAME_PLACE_M: Final = 1e-3
"""Slots less than a millimetre apart are the same."""
MAX_TABLE_BYTES: Final = 2_000_000_000
"""Memory that building a scenario's tables may take: half of a small machine's."""
LINEAR_BYTES_PER_STEP: Final = 1_400
"""Measured peak of the schedule's table, its copies included."""
VARYING_BYTES_PER_STEP: Final = 5_700
"""Measured addition for linear models that vary from step to step, those of truth and filter together."""
NONLINEAR_BYTES_PER_SUBSTEP: Final = 3_200
"""Measured addition for the leader's path, per integration step."""


def check_memory(key: str, steps: int, dt_s: float, dynamics: str, filter_dynamics: str) -> None:
    """Refuse tables larger than MAX_TABLE_BYTES.

    Args:
        key: setting to name in the error.
        steps: steps of all variants together.
        dt_s: time step, s.
        dynamics: name of the true dynamics.
        filter_dynamics: name of the filter's.

    Raises:
        ValueError: naming the key, the size and the limit.
    """
    per_step = LINEAR_BYTES_PER_STEP
    varying = {dynamics, filter_dynamics} - {NONLINEAR}
    if not all(get_dynamics(name).time_invariant for name in varying):
        per_step += VARYING_BYTES_PER_STEP
    if dynamics == NONLINEAR:
        per_step += NONLINEAR_BYTES_PER_SUBSTEP * substeps(dt_s)
    if steps * per_step > MAX_TABLE_BYTES:
        raise ValueError(
            f"{key}: tables of {steps} steps in all take about {steps * per_step / 1e9:.3g} GB; at most "
            f"{MAX_TABLE_BYTES / 1e9:g} GB, {MAX_TABLE_BYTES // per_step} steps of this scenario"
        )


def check_models(dynamics: str, filter_dynamics: str | None, orbit: Orbit, perturbations: Perturbations) -> None:
    """Refuse unknown models, and a truth that would leave out what other settings ask for."""
    for key, name, known in (
        ("dynamics", dynamics, [*DYNAMICS, NONLINEAR]),
        ("filter.dynamics", filter_dynamics, [*DYNAMICS]),
    ):
        if name is not None and name not in known:
            raise ValueError(f"{key}: no dynamics model named {name[:80]!r}; {nearest(name, known)}")
    check_truth(dynamics, orbit, perturbations)


def check_spacecraft(follower: Spacecraft, leader: Spacecraft) -> None:
    """Refuse a thruster that never fires, and two spacecraft in different air."""
    least, greatest = follower.min_accel_m_s2, math.sqrt(3) * follower.max_accel_m_s2
    if least > greatest:
        raise ValueError(
            f"spacecraft.min_accel_m_s2: must not be above the greatest thrust, {greatest:.4g}, got {least:g}"
        )
    density, leaders = follower.air_density_kg_m3, leader.air_density_kg_m3
    if leaders != density:
        raise ValueError(f"leader_spacecraft.air_density_kg_m3: must be the follower's, {density:g}, got {leaders:g}")


def check_safety(safety: Safety) -> None:
    """Refuse a collision at a distance that costs nothing."""
    if safety.collision_distance_m > safety.min_distance_m:
        raise ValueError(
            f"safety.collision_distance_m: must not be above min_distance_m = {safety.min_distance_m:g} m, "
            f"got {safety.collision_distance_m:g} m"
        )


def check_durations(phases: Sequence[Phase], orbit: Orbit, dt_s: float) -> None:
    """Refuse too many steps, and phases shorter than a step."""
    if not phases:
        raise ValueError("phases: must have at least one phase, got []")
    periods = sum(phase.transfer_orbits + phase.hold_orbits for phase in phases)
    steps = periods * orbit.period_s / dt_s
    if steps > MAX_EPISODE_STEPS:
        raise ValueError(f"dt_s: {steps:.7g} steps of {dt_s:g} s; an episode has at most {MAX_EPISODE_STEPS}")
    for index, phase in enumerate(phases):
        for key, periods in (("transfer_orbits", phase.transfer_orbits), ("hold_orbits", phase.hold_orbits)):
            if periods > 0 and whole_steps(periods, orbit, dt_s) == 0:
                seconds = periods * orbit.period_s
                raise ValueError(
                    f"phases.{index}.{key}: {periods:g} periods are {seconds:.4g} s, which rounds to no step of "
                    f"dt_s = {dt_s:g} s"
                )


def check_start(start: Start, phases: Sequence[Phase], limits: Limits, orbit: Orbit, dt_s: float) -> None:
    """Refuse a nominal start, or a change of phase, that would end the episode at once."""
    place = _state(start.formation, orbit, "start.formation")[:3]
    range_m = math.hypot(*place)
    if range_m < limits.keep_out_m:
        raise ValueError(
            f"start.formation: {range_m:.6g} m from the leader, inside limits.keep_out_m = {limits.keep_out_m:g} m"
        )
    start_s = 0.0
    for index, phase in enumerate(phases):
        _state(phase.formation, orbit, f"phases.{index}.formation")
        arrival_s = start_s + whole_steps(phase.transfer_orbits, orbit, dt_s) * dt_s
        end_s = arrival_s + whole_steps(phase.hold_orbits, orbit, dt_s) * dt_s
        distance_m = math.dist(place, phase.formation.reference(start_s, orbit, arrival_s)[:3])
        if distance_m > limits.max_distance_m:
            key = f"phases.{index}.formation" if index else "start.formation"
            raise ValueError(
                f"{key}: {distance_m:.6g} m between the {'phase before' if index else 'start'} and the phase's "
                f"reference, beyond limits.max_distance_m = {limits.max_distance_m:g} m"
            )
        place, start_s = phase.formation.reference(end_s, orbit, arrival_s)[:3], end_s


def check_followers(count: int, own: Sequence[FollowerSettings], neighbours: int | None, is_randomized: bool) -> None:
    """Refuse settings that do not fit the number of followers."""
    if own and len(own) != count:
        raise ValueError(f"follower_settings: must have {count}, one for each follower, or none, got {len(own)}")
    if neighbours is not None and neighbours >= count:
        raise ValueError(f"neighbours: each of {count} followers has {count - 1}, got {neighbours}")
    if is_randomized:
        raise ValueError(f"domain_randomization: is for a single follower, got followers = {count}")


def check_alike(key: str, own: str, others: str) -> None:
    """Refuse a follower whose sensor or filter is of another kind than the group's: all are computed side by side."""
    if own != others:
        raise ValueError(f"{key}: must be of the group's kind, {others}, got {own}")


def check_slots(start: Start, phases: Sequence[Phase], count: int, safety: Safety, orbit: Orbit, dt_s: float) -> None:
    """Refuse formations without a slot for each follower, and slots that come too near to each other or the leader."""
    places = [
        _state(each, orbit, "start.formation")[None, :3] for each in _slots(start.formation, count, orbit, "start")
    ]
    _check_distances(places, safety.min_distance_m, "start.formation")
    start_s = 0.0
    for index, phase in enumerate(phases):
        arrival_s = start_s + whole_steps(phase.transfer_orbits, orbit, dt_s) * dt_s
        end_s = arrival_s + whole_steps(phase.hold_orbits, orbit, dt_s) * dt_s
        times_s = np.arange(arrival_s, min(end_s, arrival_s + orbit.period_s) + dt_s, dt_s)
        slots = _slots(phase.formation, count, orbit, f"phases.{index}")
        paths = [slot.reference(times_s, orbit, arrival_s)[:, :3] for slot in slots]
        _check_distances(paths, safety.min_distance_m, f"phases.{index}.formation")
        start_s = end_s


def _slots(formation: Formation, count: int, orbit: Orbit, key: str) -> Sequence[Formation]:
    """The slots of a formation, which may be defined outside the package."""
    try:
        slots = formation.slots(count, orbit)
    except ValueError as error:
        raise ValueError(f"{key}.formation: {error}") from None
    if len(slots) != count:
        raise ValueError(f"{key}.formation: must have {count} slots, got {len(slots)}")
    return slots


def _check_distances(paths: Sequence[Array], least_m: float, key: str) -> None:
    """Refuse paths (T, 3), m, that meet, or come nearer than a distance to each other or to the leader."""
    for i, path in enumerate(paths):
        for j, other in enumerate(paths[:i]):
            distance_m = float(np.linalg.norm(path - other, axis=1).min())
            if distance_m < SAME_PLACE_M:
                raise ValueError(f"{key}: slots {j} and {i} are one place, or meet on the way")
            if distance_m < least_m:
                raise ValueError(f"{key}: slots {j} and {i} {_too_near(distance_m, least_m)}")
        distance_m = float(np.linalg.norm(path, axis=1).min())
        if distance_m < least_m:
            raise ValueError(f"{key}: slot {i} and the leader {_too_near(distance_m, least_m)}")


def _too_near(distance_m: float, least_m: float) -> str:
    return f"come within {distance_m:.6g} m, nearer than safety.min_distance_m = {least_m:g} m"


def _state(formation: Formation, orbit: Orbit, key: str) -> Array:
    """State (6,) of a formation, which may be defined outside the package."""
    state = np.asarray(formation.state(orbit))
    if state.shape != (6,) or not np.isfinite(state).all():
        raise ValueError(f"{key}: its state must be six finite numbers, got {str(state)[:80]}")
    return state
