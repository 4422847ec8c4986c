"""Search spaces of the policies' settings: the parameters that a tuning study varies."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Parameter:
    """Settings that a study varies together.

    Attributes:
        keys: dotted paths of the settings; a number is an axis. The first one is the parameter's name.
        low: least value, in the setting's unit.
        high: greatest value.
        log: whether it is sampled evenly in its logarithm, else in its values.
        transfer: whether it matters to transfers only.
    """

    keys: tuple[str, ...]
    low: float
    high: float
    log: bool = True
    transfer: bool = False

    @property
    def name(self) -> str:
        """Name in a study."""
        return self.keys[0]


def regulator_weights(section: str, *, transfer: bool) -> tuple[Parameter, ...]:
    """Weights of a regulator: along-track and cross-track position weights stay 1, since only ratios matter."""
    return (
        Parameter((f"{section}.position.0",), 1e-2, 1e2, transfer=transfer),
        Parameter((f"{section}.velocity_s2.0", f"{section}.velocity_s2.1"), 1e2, 1e8, transfer=transfer),
        Parameter((f"{section}.velocity_s2.2",), 1e2, 1e8, transfer=transfer),
        Parameter((f"{section}.control_s2.0", f"{section}.control_s2.1"), 1, 1e8, transfer=transfer),
        Parameter((f"{section}.control_s2.2",), 1, 1e8, transfer=transfer),
    )


REGULATOR: Final = (*regulator_weights("transfer", transfer=True), *regulator_weights("hold", transfer=False))
REWEIGHTED_LQG: Final = (
    Parameter(("reweighted_lqg.floor",), 1e-5, 1e-2),
    Parameter(("reweighted_lqg.error_weight_scale",), 0.3, 3),
)
CORRECTION: Final = (
    Parameter(("correction.miss_m",), 0.3, 300, transfer=True),
    Parameter(("correction.miss_sigmas",), 0.2, 10, transfer=True),
)
STATION_KEEPING: Final = (
    Parameter(("station_keeping.band_m",), 0.5, 200),
    Parameter(("station_keeping.look_ahead_orbits",), 0.05, 2),
    Parameter(("station_keeping.least_reduction",), 0, 0.95, log=False),
)
