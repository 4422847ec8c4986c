"""Losses in bursts."""

from typing import Literal

from formation_env.dropout.base import Dropout, LinkChain
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import PositiveDuration, PositiveOrbits
from formation_env.settings import settings


@settings(renamed={"mean_between_periods": "mean_uptime_orbits"})
class GilbertElliott(Dropout):
    """Outages and uptimes of random, geometrically distributed length (Gilbert 1960).

    Attributes:
        mean_outage_s: mean duration of an outage, s; not below the step.
        mean_uptime_orbits: mean time from the end of an outage to the start of the next, in orbital periods.
    """

    kind: Literal["gilbert_elliott"] = "gilbert_elliott"
    mean_outage_s: PositiveDuration = 600.0
    mean_uptime_orbits: PositiveOrbits = 1.0

    def chain(self, dt_s: float, orbit: Orbit) -> LinkChain:
        """The chain in which an outage or uptime of mean length L ends at each step with probability dt / L."""
        between_s = self.mean_uptime_orbits * orbit.period_s
        for name, spell_s in (("mean_outage_s", self.mean_outage_s), ("mean_uptime_orbits", between_s)):
            if spell_s < dt_s:
                raise ValueError(f"dropout.{name}: a mean of {spell_s:g} s is shorter than the step dt_s = {dt_s:g} s")
        return LinkChain(fail=dt_s / between_s, recover=dt_s / self.mean_outage_s)
