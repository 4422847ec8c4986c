"""Domain randomization: what differs from episode to episode, and the scenarios that it may come to."""

from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Final, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, Strict

from formation_env.settings import NonNegative, Positive, settings

if TYPE_CHECKING:
    pass

T = TypeVar("T")


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
        outage_spacing_factor: of dropout.mean_uptime_orbits.
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
