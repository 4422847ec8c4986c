"""Domain randomization: what differs from episode to episode, and the scenarios that it may come to."""

from dataclasses import fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, Strict, ValidationError

from formation_env.settings import NonNegative, Positive, faults, settings

if TYPE_CHECKING:
    from formation_env.scenario import Scenario

T = TypeVar("T")

MOST_STEPS: Final = 500_000
"""Of all variants together; their plans are kept as tables, of about 400 bytes for each."""


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError(f"must be [low, high] with low <= high, got {list(pair)}")
    return pair


Range = Annotated[tuple[NonNegative, NonNegative], AfterValidator(_ordered)]
PositiveRange = Annotated[tuple[Positive, Positive], AfterValidator(_ordered)]


@settings
class DomainRandomization:
    """What differs from episode to episode: ranges [low, high], each a scenario's quantity or a factor of it.

    As many complete scenarios as asked for, the variants, are drawn once; each episode flies one of them, all equally
    likely. The ranges are covered evenly (Latin hypercube: McKay, Beckman & Conover 1979). What is left out stays as it
    is. The filter knows of the changes as far as `filter` leaves it to the truth.

    Attributes:
        variants: how many scenarios are drawn.
        seed: of the drawing.
        formation_size_factor: of the lengths and velocities of all formations, the start's included.
        start_spread_factor: of the spread of the start.
        sensor_noise_factor: of the sensor's sigmas.
        process_noise_factor: of process_noise_m_s2.
        outage_length_factor: of dropout.mean_outage_s.
        outage_spacing_factor: of dropout.mean_between_periods.
        loss_probability_factor: of dropout.loss_probability.
        max_accel_factor: of the follower's thrust limit.
        ballistic_coefficient_factor: of the follower's m / (C_d S), by its drag coefficient; the leader's stays.
        altitude_m: the leader's altitude, m; so the period and the number of steps differ, too.
        inclination_deg: the leader's inclination, deg.
    """

    variants: Annotated[int, Strict(), Field(ge=1)] = 64
    seed: Annotated[int, Strict(), Field(ge=0)] = 0
    formation_size_factor: Range | None = None
    start_spread_factor: Range | None = None
    sensor_noise_factor: Range | None = None
    process_noise_factor: Range | None = None
    outage_length_factor: Range | None = None
    outage_spacing_factor: Range | None = None
    loss_probability_factor: Range | None = None
    max_accel_factor: Range | None = None
    ballistic_coefficient_factor: PositiveRange | None = None
    altitude_m: Range | None = None
    inclination_deg: Range | None = None

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """What is varied, and between which limits."""
        found = {name: getattr(self, name) for name in QUANTITIES}
        return {name: ends for name, ends in found.items() if ends is not None}

    def draw(self) -> list[dict[str, float]]:
        """The varied quantities of each variant."""
        generator = np.random.default_rng(self.seed)
        cells = np.tile(np.arange(self.variants), (len(QUANTITIES), 1))
        # each of as many equal cells of a range has one variant, somewhere in it
        shares = (generator.permuted(cells, axis=1) + generator.random(cells.shape)) / self.variants
        columns = {name: shares[QUANTITIES.index(name)].tolist() for name in self.ranges}
        return [
            {name: low + (high - low) * columns[name][k] for name, (low, high) in self.ranges.items()}
            for k in range(self.variants)
        ]


QUANTITIES: Final = tuple(f.name for f in fields(DomainRandomization) if f.name not in ("variants", "seed"))
_OF_DROPOUT: Final = {
    "outage_length_factor": "mean_outage_s",
    "outage_spacing_factor": "mean_between_periods",
    "loss_probability_factor": "loss_probability",
}
"""Quantities of the dropout model, and their names there; no model has them all."""


@lru_cache(maxsize=16)
def draw_variants(scenario: "Scenario") -> tuple["Scenario", ...]:
    """What episodes of a scenario fly: complete scenarios without randomization, or it alone if it has none.

    Raises:
        ValueError: a range does not fit the scenario, or what is drawn makes no valid one; one line that names it.
    """
    wanted = scenario.domain_randomization
    if wanted is None:
        return (scenario,)
    steps = wanted.variants * scenario.num_steps
    if steps > MOST_STEPS:
        raise ValueError(f"domain_randomization.variants: must have at most {MOST_STEPS} steps together, got {steps}")
    for name, key in _OF_DROPOUT.items():
        if name in wanted.ranges and not hasattr(scenario.dropout, key):
            raise ValueError(f"domain_randomization.{name}: dropout {scenario.dropout.kind} has no {key}")
    for name, ends in wanted.ranges.items():
        for end in ends:
            _vary(scenario, {name: end})
    return tuple(_vary(scenario, values) for values in wanted.draw())


def _vary(scenario: "Scenario", values: dict[str, float]) -> "Scenario":
    """The scenario with some quantities changed, and no randomization."""
    try:
        return replace(scenario, domain_randomization=None, **_parts(scenario, values))
    except ValidationError as error:
        what = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        raise ValueError(f"domain_randomization: {what}: {'; '.join(faults(error))}") from None


def _parts(scenario: "Scenario", values: dict[str, float]) -> dict[str, Any]:
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
        "start": _scaled(start, factor["start_spread_factor"], ("spread_pos_m", "spread_vel_m_s")),
        "phases": tuple(replace(phase, formation=_resized(phase.formation, size)) for phase in scenario.phases),
    }


def _resized(formation: T, factor: float) -> T:
    """A formation with its lengths and velocities multiplied."""
    return _scaled(formation, factor, tuple(key for key in vars(formation) if key.endswith(("_m", "_m_s"))))


def _scaled(part: T, factor: float, keys: tuple[str, ...]) -> T:
    """A part of a scenario with some of its numbers multiplied."""
    return replace(part, **{key: factor * getattr(part, key) for key in keys})  # type: ignore[type-var]
