"""Parts of a scenario: where an episode starts, its phases, and the limits that end it early."""

from formation_env.formations import AnyFormation, AtLeader
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Distance, PositiveDistance, Speed
from formation_env.settings import NonNegative, Positive, settings


@settings(renamed={"spread_pos_m": "initial_sigma_pos_m", "spread_vel_m_s": "initial_sigma_vel_m_s"})
class Start:
    """Distribution of an episode's start.

    Attributes:
        formation: the nominal start is this formation's state.
        initial_sigma_pos_m: 1-sigma of the true position about the nominal one, each axis, m.
        initial_sigma_vel_m_s: 1-sigma of the true velocity about the nominal one, each axis, m/s.
    """

    formation: AnyFormation = AtLeader()
    initial_sigma_pos_m: Distance = 10.0
    initial_sigma_vel_m_s: Speed = 0.01


@settings(renamed={"transfer_periods": "transfer_orbits", "hold_periods": "hold_orbits"})
class Phase:
    """One phase of the mission: a transfer to a formation, then its hold.

    Both times are rounded to whole steps.

    Attributes:
        formation: the target; the follower should be at its state at the arrival.
        transfer_orbits: duration of the transfer, in orbital periods; 0 for none.
        hold_orbits: duration of the hold, in orbital periods.
    """

    formation: AnyFormation
    transfer_orbits: NonNegative = 0.0
    hold_orbits: Positive


@settings
class Limits:
    """Limits that end an episode early.

    Attributes:
        max_distance_m: greatest distance from the reference, m.
        keep_out_m: radius of the keep-out sphere around the leader, m; 0 for none.
    """

    max_distance_m: PositiveDistance = 50e3
    keep_out_m: Distance = 0.0


def whole_steps(periods: float, orbit: Orbit, dt_s: float) -> int:
    """Nearest whole number of steps of a time in orbital periods."""
    return round(periods * orbit.period_s / dt_s)
