"""Infos: which results of a step they show, and the form in which Gymnasium wants those of a batch."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation_env.kernel.results import PLACES, StepResults
from formation_env.task.scenario import Scenario

THRUST: Final = "accel_m_s2"
TOTALS: Final = "episode_totals"
_SHOWN: Final = {
    "true_state": "true_state",
    "estimate": "estimate",
    THRUST: "thrust",
    "position_error_m": "position_error",
    "delta_v_m_s": "delta_v",
    "error_cost_m_s": "error_cost",
    "exit_cost_m_s": "exit_cost",
    "nis": "nis",
    "measured": "measured",
    "phase": "phase",
}
"""Info keys and the results that they show."""
COST: Final = "cost"
_OF_LIMITS: Final = {COST: "cost", "least_distance_m": "least_distance"}
_OF_VARIANTS: Final = {"variant": "variant"}
_OF_ANALYSIS: Final = {
    "measurement": "measurement",
    "innovation": "innovation",
    "process_noise_m_s2": "process_noise",
    "thrust_noise": "thrust_noise",
}
_MEASURED_BY_POSITION: Final = 3


class Info(NamedTuple):
    """An info key.

    Attributes:
        name: the key.
        mask: the key, with an underscore, of the flags which rows have the info.
        block: number of the block of `StepResults` that holds it.
        place: its fields there.
    """

    name: str
    mask: str
    block: int
    place: int | slice


def keys_of(scenario: Scenario, guarded: bool, analysis: bool) -> tuple[Info, ...]:
    """The info keys of a scenario's environments.

    Args:
        scenario: the scenario.
        guarded: whether it limits anything that costs.
        analysis: whether the step's noises are among them, see `FormationEnv`.
    """
    shown: dict[str, str] = dict(_SHOWN)
    if scenario.domain_randomization is not None:
        shown |= _OF_VARIANTS
    if guarded:
        shown |= _OF_LIMITS
    if analysis:
        shown |= _OF_ANALYSIS
    infos = []
    for name, result in shown.items():
        block, place = PLACES[result]
        if scenario.sensor.measures == "position" and name in ("measurement", "innovation"):
            assert isinstance(place, slice)
            place = slice(place.start, place.start + _MEASURED_BY_POSITION)
        infos.append(Info(name, f"_{name}", block, place))
    return tuple(infos)


def batched(infos: tuple[Info, ...], results: StepResults, mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Infos in Gymnasium's form: views of the results (rows,) or (rows, size), each with the same mask."""
    blocks, num_rows = results.blocks, results.num_rows
    shown: dict[str, Any] = {}
    for name, mask_name, block, place in infos:
        shown[name] = blocks[block][place, :num_rows].T
        shown[mask_name] = mask
    return shown


def with_mask(values: Mapping[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Values of some rows in Gymnasium's form."""
    return {**values, **{f"_{name}": mask for name in values}}
