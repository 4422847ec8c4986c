"""Variants of a scenario with domain randomization: complete scenarios, drawn once."""

from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, TypeVar

from formation_env.settings import ConfigError, faults_of
from formation_env.task.checks import check_memory
from formation_env.task.randomization import QUANTITIES
from formation_env.task.scenario import Scenario

T = TypeVar("T")

_OF_DROPOUT: Final = {
    "outage_length_factor": "mean_outage_s",
    "outage_spacing_factor": "mean_uptime_orbits",
    "loss_probability_factor": "loss_probability",
}
"""Quantities of the dropout model, and their keys there; no model has all of them."""


@lru_cache(maxsize=16)
def draw_variants(scenario: Scenario) -> tuple[Scenario, ...]:
    """Draw the scenarios that episodes fly, none of them randomized; without randomization it is the scenario alone.

    Raises:
        ValueError: a range does not fit the scenario, or a variant is invalid; one line that names key and value.
    """
    randomization = scenario.domain_randomization
    if randomization is None:
        return (scenario,)
    steps = randomization.variants * scenario.num_steps
    dynamics, filter_dynamics = scenario.dynamics, scenario.filter_model.dynamics
    check_memory("domain_randomization.variants", steps, scenario.dt_s, dynamics, filter_dynamics)
    for name, key in _OF_DROPOUT.items():
        if name in randomization.ranges and not hasattr(scenario.dropout, key):
            raise ValueError(f"domain_randomization.{name}: dropout {scenario.dropout.kind} has no {key}")
    for name, ends in randomization.ranges.items():
        for end in ends:
            _vary(scenario, {name: end})
    return tuple(_vary(scenario, values) for values in randomization.draw())


def _vary(scenario: Scenario, values: dict[str, float]) -> Scenario:
    """Change some quantities of a scenario, and remove its randomization."""
    try:
        return replace(scenario, domain_randomization=None, **_parts(scenario, values))
    except ConfigError as error:
        drawn = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        raise ValueError(f"domain_randomization: {drawn}: {faults_of(error)}") from None


def _parts(scenario: Scenario, values: dict[str, float]) -> dict[str, Any]:
    """Fields of the changed scenario that depend on the quantities."""
    factor = dict.fromkeys(QUANTITIES, 1.0) | values
    orbit, craft, dropout = scenario.orbit, scenario.spacecraft, scenario.dropout
    size, own_drag = factor["formation_size_factor"], "ballistic_coefficient_factor" in values
    for name in values.keys() & _OF_DROPOUT.keys():
        dropout = _scaled(dropout, factor[name], (_OF_DROPOUT[name],))
    start = replace(scenario.start, formation=_resized(scenario.start.formation, size))
    absolute: dict[str, Any] = {name: values[name] for name in ("altitude_m", "inclination_deg") if name in values}
    return {
        "orbit": replace(orbit, **absolute),
        # 1 / B = C_d S / m; the surface also catches the sunlight
        "spacecraft": replace(
            craft,
            drag_coefficient=craft.drag_coefficient / factor["ballistic_coefficient_factor"],
            max_accel_m_s2=craft.max_accel_m_s2 * factor["max_accel_factor"],
        ),
        "leader_spacecraft": scenario.leader if own_drag else scenario.leader_spacecraft,
        "process_noise_m_s2": scenario.process_noise_m_s2 * factor["process_noise_factor"],
        "sensor": _scaled(scenario.sensor, factor["sensor_noise_factor"], ("sigma_pos_m", "sigma_vel_m_s")),
        "dropout": dropout,
        "start": _scaled(start, factor["start_spread_factor"], ("initial_sigma_pos_m", "initial_sigma_vel_m_s")),
        "phases": tuple(replace(phase, formation=_resized(phase.formation, size)) for phase in scenario.phases),
    }


def _resized(formation: T, factor: float) -> T:
    """Multiply the lengths and velocities of a formation."""
    return _scaled(formation, factor, tuple(key for key in vars(formation) if key.endswith(("_m", "_m_s"))))


def _scaled(part: T, factor: float, keys: tuple[str, ...]) -> T:
    """Multiply some numbers of a part of a scenario."""
    return replace(part, **{key: factor * getattr(part, key) for key in keys})  # type: ignore[type-var]
