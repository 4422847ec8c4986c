"""The observation: its one layout, used by the environments, the policies and the documentation.

It never holds the truth: all of it comes from the filter's estimate, the clock and the plan.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import leg_reference, legs

BOUND: Final = 30.0
"""Every element lies within [-BOUND, BOUND]; what is beyond is cut off."""
LEAST_LENGTH_M: Final = 1000.0
LOG_UNIT_POS_M: Final = 1.0
LOG_UNIT_VEL_M_S: Final = 1e-3
LOG_RANGE: Final = 1e4
"""The compressed elements reach 1 at this many units."""
SIGMA_UNIT_POS_M: Final = 1.0
SIGMA_UNIT_VEL_M_S: Final = 1e-3
SIGMA_DECADES: Final = 3.0
"""The logarithm of sigma reaches 1 this many decades above its unit."""
SIGMA_FLOOR: Final = 1e-6
"""Sigmas below this many units are shown as this."""


@dataclass(frozen=True)
class Block:
    """Neighbouring elements of the observation.

    Attributes:
        name: what to ask for.
        size: how many elements.
        meaning: for the documentation.
        unit: of the physical value.
        scale: how the physical value becomes the element.
    """

    name: str
    size: int
    meaning: str
    unit: str
    scale: str


_LINEAR = "/ (L, n L)"
_COMPRESSED = "sign(e) log(1 + |e| / (1 m, 1 mm/s)) / log(1 + 1e4)"

BLOCKS: Final = (
    Block("error", 6, "estimated state minus reference state", "m, m/s", _LINEAR),
    Block(
        "zero_effort_miss",
        6,
        "error at the arrival if the follower coasts until then; in hold the error now",
        "m, m/s",
        _LINEAR,
    ),
    Block("error_log", 6, "error, compressed", "m, m/s", _COMPRESSED),
    Block("zero_effort_miss_log", 6, "zero_effort_miss, compressed", "m, m/s", _COMPRESSED),
    Block("reference", 6, "reference state", "m, m/s", _LINEAR),
    Block("time_to_arrival", 1, "time to the end of the transfer; 0 in hold", "s", "/ period"),
    Block("in_hold", 1, "1 in hold, 0 in transfer", "", ""),
    Block("phase", 1, "index of the phase", "", "/ number of phases"),
    Block("time_left", 1, "time to the end of the phase", "s", "/ period"),
    Block("sigma_pos", 1, "filter's 1-sigma position error, root mean square of the axes", "m", "log10(/ 1 m) / 3"),
    Block(
        "sigma_vel", 1, "filter's 1-sigma velocity error, root mean square of the axes", "m/s", "log10(/ 1 mm/s) / 3"
    ),
    Block("measured", 1, "1 if the last measurement arrived, else 0", "", ""),
    Block(
        "measurement_age",
        1,
        "time since the last measurement that arrived, or since the start",
        "s",
        "log(1 + / dt) / log(1 + period / dt)",
    ),
)


NEIGHBOUR_BLOCKS: Final = (
    Block("relative_estimate", 6, "its estimated state, by its last message, minus one's own", "m, m/s", _LINEAR),
    Block("relative_reference", 6, "its reference state minus one's own", "m, m/s", _LINEAR),
    Block("closest_distance", 1, "least distance in the coming half orbit if both coast (HCW)", "m", "/ L"),
    Block("closest_time", 1, "time until then", "s", "/ period"),
    Block("message_age", 1, "time since its last message", "s", "log(1 + / dt) / log(1 + period / dt)"),
    Block(
        "relative_sigma_pos", 1, "1-sigma error of the relative position, as of `sigma_pos`", "m", "log10(/ 1 m) / 3"
    ),
    Block("present", 1, "1; or 0 if its episode has ended, and all of the block with it", "", ""),
)
"""What a follower's observation shows of each neighbour, behind its own; the least `closest_distance` comes first."""


def _slices(blocks: tuple[Block, ...]) -> dict[str, slice]:
    ends = np.cumsum([block.size for block in blocks])
    return {block.name: slice(int(end) - block.size, int(end)) for block, end in zip(blocks, ends, strict=True)}


SLICES: Final = _slices(BLOCKS)
SIZE: Final = sum(block.size for block in BLOCKS)
NEIGHBOUR_SLICES: Final = _slices(NEIGHBOUR_BLOCKS)
NEIGHBOUR_SIZE: Final = sum(block.size for block in NEIGHBOUR_BLOCKS)


@dataclass(frozen=True)
class ObservationLayout:
    """Places and scales of the quantities in a scenario's observation.

    Attributes:
        length_m: L, the largest distance of the plan from the leader; at least 1 km, and at least so much that errors
            up to the scenario's distance limit stay within the bounds.
        mean_motion_rad_s: n; n L is the scale of velocities.
        period_s: the scale of times, s.
        num_phases: phases of the plan.
        dt_s: the step, s.
        num_neighbours: how many other followers it shows.
    """

    length_m: float
    mean_motion_rad_s: float
    period_s: float
    num_phases: int
    dt_s: float
    num_neighbours: int

    @property
    def size(self) -> int:
        """Number of elements."""
        return SIZE + self.num_neighbours * NEIGHBOUR_SIZE

    @property
    def state_scale(self) -> Array:
        """Scale (6,) of states: m and m/s per unit."""
        return np.repeat([self.length_m, self.length_m * self.mean_motion_rad_s], 3)

    def state(self, observation: NDArray[np.floating], name: str) -> Array:
        """A block of six, `error`, `zero_effort_miss` or `reference`, in m and m/s.

        Args:
            observation: (..., size).
            name: the block.

        Returns:
            States (..., 6).
        """
        block: Array = observation[..., SLICES[name]] * self.state_scale
        return block

    def estimate(self, observation: NDArray[np.floating]) -> Array:
        """The filter's estimated LVLH state (..., 6), m and m/s."""
        return self.state(observation, "error") + self.state(observation, "reference")

    def scalar(self, observation: NDArray[np.floating], name: str) -> Array:
        """A block of one (...), in units of the observation."""
        value: Array = observation[..., SLICES[name].start].astype(np.float64)
        return value

    def time_to_arrival_s(self, observation: NDArray[np.floating]) -> Array:
        """Time to arrival (...), s."""
        return self.scalar(observation, "time_to_arrival") * self.period_s

    def phase(self, observation: NDArray[np.floating]) -> NDArray[np.intp]:
        """Index of the phase (...)."""
        return np.rint(self.scalar(observation, "phase") * self.num_phases).astype(np.intp)

    def neighbours(self, observation: NDArray[np.floating], name: str) -> Array:
        """A block of all neighbours, nearest first, in SI units.

        Args:
            observation: (..., size).
            name: the block, of `NEIGHBOUR_BLOCKS`.

        Returns:
            States (..., num_neighbours, 6), or numbers (..., num_neighbours).
        """
        shape = (*observation.shape[:-1], self.num_neighbours, NEIGHBOUR_SIZE)
        block: Array = observation[..., SIZE:].reshape(shape)[..., NEIGHBOUR_SLICES[name]].astype(np.float64)
        if name.startswith("relative") and block.shape[-1] == 6:
            return block * self.state_scale
        value = block[..., 0]
        if name == "message_age":
            return np.asarray(np.expm1(value * np.log1p(self.period_s / self.dt_s)) * self.dt_s)
        if name == "relative_sigma_pos":
            return np.asarray(SIGMA_UNIT_POS_M * 10 ** (SIGMA_DECADES * value))
        return value * {"closest_distance": self.length_m, "closest_time": self.period_s, "present": 1.0}[name]


def markdown_table(blocks: tuple[Block, ...] = BLOCKS) -> str:
    """Blocks as a Markdown table: index, name, meaning, unit, scale."""
    lines = ["| index | name | meaning | unit | scale |", "|---|---|---|---|---|"]
    for block, place in zip(blocks, _slices(blocks).values(), strict=True):
        first, last = place.start, place.stop - 1
        index = f"{first}" if first == last else f"{first}-{last}"
        cells = (index, f"`{block.name}`", block.meaning, block.unit, block.scale.replace("|", "\\|"))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def observation_layout(scenario: Scenario) -> ObservationLayout:
    """The observation layout with the scenario's scales."""
    return ObservationLayout(
        length_m=scenario.observation_length_m or _largest_distance_m(scenario),
        mean_motion_rad_s=scenario.orbit.mean_motion_rad_s,
        period_s=scenario.orbit.period_s,
        num_phases=len(scenario.phases),
        dt_s=scenario.dt_s,
        num_neighbours=scenario.num_neighbours,
    )


def _largest_distance_m(scenario: Scenario) -> float:
    """The largest distance of the plan from the leader, in any slot, and at least what the limits need."""
    count, orbit = scenario.followers, scenario.orbit
    starts = [slot.state(orbit) for slot in scenario.start.formation.slots(count, orbit)]
    held = [
        leg_reference(scenario, leg, np.arange(leg.arrival, leg.end + 1), slot)
        for leg in legs(scenario)
        for slot in leg.phase.formation.slots(count, orbit)
    ]
    farthest_m = np.linalg.norm(np.vstack([*starts, *held])[:, :3], axis=1).max()
    return float(max(farthest_m, LEAST_LENGTH_M, scenario.limits.max_distance_m / BOUND))
