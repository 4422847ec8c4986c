"""Variants of a scenario with domain randomization: complete scenarios, drawn once."""

from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

from pydantic import ValidationError

from formation_env.settings import faults
from formation_env.task.randomization import QUANTITIES, T
from formation_env.task.scenario import Scenario

MAX_VARIANT_STEPS: Final = 500_000
"""Of all variants together; their plans are kept as tables, of about 400 bytes for each."""


_OF_DROPOUT: Final = {
    "outage_length_factor": "mean_outage_s",
    "outage_spacing_factor": "mean_uptime_orbits",
    "loss_probability_factor": "loss_probability",
}
"""Quantities of the dropout model, and their names there; no model has them all."""


@lru_cache(maxsize=16)
def draw_variants(scenario: Scenario) -> tuple[Scenario, ...]:
    """What episodes of a scenario fly: complete scenarios without randomization, or it alone if it has none.

    Raises:
        ValueError: a range does not fit the scenario, or what is drawn makes no valid one; one line that names it.
    """
    wanted = scenario.domain_randomization
    if wanted is None:
        return (scenario,)
    steps = wanted.variants * scenario.num_steps
    if steps > MAX_VARIANT_STEPS:
        raise ValueError(
            f"domain_randomization.variants: must have at most {MAX_VARIANT_STEPS} steps together, got {steps}"
        )
    for name, key in _OF_DROPOUT.items():
        if name in wanted.ranges and not hasattr(scenario.dropout, key):
            raise ValueError(f"domain_randomization.{name}: dropout {scenario.dropout.kind} has no {key}")
    for name, ends in wanted.ranges.items():
        for end in ends:
            _vary(scenario, {name: end})
    return tuple(_vary(scenario, values) for values in wanted.draw())


def _vary(scenario: Scenario, values: dict[str, float]) -> Scenario:
    """The scenario with some quantities changed, and no randomization."""
    try:
        return replace(scenario, domain_randomization=None, **_parts(scenario, values))
    except ValidationError as error:
        what = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        raise ValueError(f"domain_randomization: {what}: {'; '.join(faults(error))}") from None


def _parts(scenario: Scenario, values: dict[str, float]) -> dict[str, Any]:
    """The parts of a scenario that depend on the quantities, changed."""
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
    """A formation with its lengths and velocities multiplied."""
    return _scaled(formation, factor, tuple(key for key in vars(formation) if key.endswith(("_m", "_m_s"))))


def _scaled(part: T, factor: float, keys: tuple[str, ...]) -> T:
    """A part of a scenario with some of its numbers multiplied."""
    return replace(part, **{key: factor * getattr(part, key) for key in keys})  # type: ignore[type-var]
