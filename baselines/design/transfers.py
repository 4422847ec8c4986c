"""Transfers between orbits: two impulses, or the spiral of a continuous low thrust.

Legend: Phi transition matrix over the transfer, delta the effect of the constant disturbance.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from formation_env.dynamics.base import DiscreteModel
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import MU_EARTH

LEAST_LEVERAGE: Final = 1 / 30
"""Least effect of an impulse on the position that it should change, in units of the transfer time or of 1 / n."""
ROUNDING_LEVERAGE: Final = 1e-9
"""Share of the greatest leverage below which one is the rounding of zero: dividing by it gives noise, by any BLAS."""


@dataclass(frozen=True)
class Hohmann:
    """A transfer between coplanar circular orbits by two impulses along the flight.

    Attributes:
        first_m_s: change of speed on the orbit of departure, m/s; negative brakes.
        second_m_s: change of speed on the orbit of arrival, m/s.
        time_s: between them, s.
    """

    first_m_s: float
    second_m_s: float
    time_s: float

    @property
    def delta_v_m_s(self) -> float:
        """Sum of the impulses' magnitudes, m/s."""
        return abs(self.first_m_s) + abs(self.second_m_s)


def hohmann(departure_m: float, arrival_m: float) -> Hohmann:
    """The Hohmann transfer between two circular orbits about the Earth (Ma 2009, eq. 3.10-3.12).

    Args:
        departure_m: radius of the orbit of departure, m.
        arrival_m: radius of the orbit of arrival, m; above or below.

    Raises:
        ValueError: a radius that is not positive.
    """
    _check_radii(departure_m, arrival_m)
    total = departure_m + arrival_m
    return Hohmann(
        # delta v_A = sqrt(mu / r_A) (sqrt(2 r_B / (r_A + r_B)) - 1)
        first_m_s=math.sqrt(MU_EARTH / departure_m) * (math.sqrt(2 * arrival_m / total) - 1),
        # delta v_B = sqrt(mu / r_B) (1 - sqrt(2 r_A / (r_A + r_B)))
        second_m_s=math.sqrt(MU_EARTH / arrival_m) * (1 - math.sqrt(2 * departure_m / total)),
        # t_H = pi sqrt((r_A + r_B)^3 / (8 mu))
        time_s=math.pi * math.sqrt(total**3 / (8 * MU_EARTH)),
    )


def spiral_delta_v(departure_m: float, arrival_m: float) -> float:
    """Delta-v of the spiral between two coplanar circular orbits that a weak thrust along the flight makes, m/s.

    It is |v_A - v_B| (Edelbaum 1961) in the limit of a thrust far below gravity, over many revolutions.

    Args:
        departure_m: radius of the orbit of departure, m.
        arrival_m: radius of the orbit of arrival, m.

    Raises:
        ValueError: a radius that is not positive.
    """
    _check_radii(departure_m, arrival_m)
    return abs(math.sqrt(MU_EARTH / departure_m) - math.sqrt(MU_EARTH / arrival_m))


def spiral_ratio(departure_m: float, arrival_m: float) -> float:
    """The spiral's delta-v over Hohmann's: Ma 2009, section 3.2.1, has "up to 141 % greater".

    It depends on the ratio of the radii alone and grows with it: from 1 between neighbours to 1 / (sqrt(2) - 1) = 2.414
    for an escape, which no finite transfer reaches.

    Args:
        departure_m: radius of the orbit of departure, m.
        arrival_m: radius of the orbit of arrival, m.

    Raises:
        ValueError: a radius that is not positive, or equal radii.
    """
    if departure_m == arrival_m:
        raise ValueError(f"arrival_m: must differ from departure_m = {departure_m:g}, got {arrival_m:g}")
    return spiral_delta_v(departure_m, arrival_m) / hohmann(departure_m, arrival_m).delta_v_m_s


def _check_radii(departure_m: float, arrival_m: float) -> None:
    for key, radius_m in (("departure_m", departure_m), ("arrival_m", arrival_m)):
        if not (radius_m > 0 and math.isfinite(radius_m)):
            raise ValueError(f"{key}: must be > 0 and finite, got {radius_m:g}")


@dataclass(frozen=True)
class TwoImpulse:
    """A transfer between two relative states by two impulses.

    Attributes:
        first_m_s: impulse (3,) at the start, LVLH, m/s.
        second_m_s: impulse (3,) at the end, LVLH, m/s.
    """

    first_m_s: Array
    second_m_s: Array

    @property
    def delta_v_m_s(self) -> float:
        """Sum of the impulses' magnitudes, m/s."""
        return float(np.linalg.norm(self.first_m_s) + np.linalg.norm(self.second_m_s))


def two_impulse(model: DiscreteModel, time_s: float, mean_motion_rad_s: float, start: Array, goal: Array) -> TwoImpulse:
    """The impulses that lead from one relative state to another in a given time, by a linear model.

    At some times an impulse has no leverage on a part of the place: about half periods cross-track, about whole periods
    radially. Then the goal must lie where the follower coasts to; the idle part of the first impulse is none.

    Args:
        model: the model over the whole transfer, see `DiscreteModel.from_start`.
        time_s: the transfer time, s.
        mean_motion_rad_s: of the leader; it tells what little leverage is.
        start: state (6,) before the first impulse, m and m/s.
        goal: state (6,) after the second impulse.

    Raises:
        ValueError: the impulses have too little leverage on the goal at this time.
    """
    coast = model.Phi @ start + model.delta
    # r_B = Phi_rr r_A + Phi_rv (v_A + impulse), one direction of leverage after the other
    U, leverage_s, Vt = np.linalg.svd(model.Phi[:3, 3:])
    miss = U.T @ (goal - coast)[:3]
    resolved_s = ROUNDING_LEVERAGE * leverage_s[0]
    parts = miss / np.maximum(leverage_s, resolved_s)
    if np.abs(parts).max() * LEAST_LEVERAGE * min(time_s, 1 / mean_motion_rad_s) > np.linalg.norm(miss):
        worst = int(np.abs(parts).argmax())
        raise ValueError(
            f"time_s: no two impulses {time_s:.6g} s apart ({time_s * mean_motion_rad_s / math.tau:.4g} periods) "
            f"reach the goal: {abs(miss[worst]):.4g} m off along LVLH {np.round(U[:, worst], 2).tolist()}, on which "
            "the first has no leverage"
        )
    first = Vt.T @ np.where(leverage_s > resolved_s, parts, 0.0)
    arrival = coast + model.Phi[:, 3:] @ first
    return TwoImpulse(first, (goal - arrival)[3:])
