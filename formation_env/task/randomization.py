"""Domain randomization: quantities that differ from episode to episode, and their samples."""

from dataclasses import fields
from typing import Annotated, Final

import numpy as np
from pydantic import AfterValidator, Field, Strict

from formation_env.settings import NonNegative, Positive, settings


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError(f"must be [low, high] with low <= high, got {list(pair)}")
    return pair


Range = Annotated[tuple[NonNegative, NonNegative], AfterValidator(_ordered)]
PositiveRange = Annotated[tuple[Positive, Positive], AfterValidator(_ordered)]


@settings
class DomainRandomization:
    """Ranges [low, high] of the quantities that differ from episode to episode, absolute or as factors.

    Complete scenarios, the variants, are drawn once; each episode flies one of them, all equally likely. The ranges are
    covered evenly (Latin hypercube: McKay, Beckman & Conover 1979). A quantity left out keeps its nominal value. The
    filter's model follows the variant except where `filter` fixes a value.

    Attributes:
        variants: number of scenarios that are drawn.
        seed: seed of the draw.
        formation_size_factor: of the lengths and velocities of all formations, the start's included.
        start_spread_factor: of start.initial_sigma_pos_m and initial_sigma_vel_m_s.
        sensor_noise_factor: of the sensor's sigmas.
        process_noise_factor: of process_noise_m_s2.
        outage_length_factor: of dropout.mean_outage_s.
        outage_spacing_factor: of dropout.mean_uptime_orbits.
        loss_probability_factor: of dropout.loss_probability.
        max_accel_factor: of the follower's thrust limit.
        ballistic_coefficient_factor: of the follower's m / (C_d S), by its drag coefficient; the leader's stays.
        altitude_m: the leader's altitude, m; period and number of steps follow from it.
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
        """Range of each quantity that varies."""
        ranges = {name: getattr(self, name) for name in QUANTITIES}
        return {name: ends for name, ends in ranges.items() if ends is not None}

    def draw(self) -> list[dict[str, float]]:
        """Values of the varying quantities, of each variant."""
        generator = np.random.default_rng(self.seed)
        cells = np.tile(np.arange(self.variants), (len(QUANTITIES), 1))
        # each range has as many equal cells as there are variants, and one variant somewhere in each cell
        shares = (generator.permuted(cells, axis=1) + generator.random(cells.shape)) / self.variants
        columns = {name: shares[QUANTITIES.index(name)].tolist() for name in self.ranges}
        return [
            {name: low + (high - low) * columns[name][k] for name, (low, high) in self.ranges.items()}
            for k in range(self.variants)
        ]


QUANTITIES: Final = tuple(f.name for f in fields(DomainRandomization) if f.name not in ("variants", "seed"))
