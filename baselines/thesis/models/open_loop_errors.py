"""How far the linear models stray from the nonlinear truth when nobody thrusts.

Leader and followers have no air, so that what strays is what the models make of the Earth: of its oblateness, of the
leader's ellipse, and of the followers' distance. The perigee is 600 km high; t = 0 is there, at the ascending node.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
import pandas as pd

from formation_env.dynamics import NONLINEAR
from formation_env.dynamics.propagation import propagate
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.formations import Following, Formation, InTrack, ProjectedCircle, SpaceCircle, XYEllipse
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import R_EARTH
from formation_env.orbital.orbit import Orbit


@dataclass(frozen=True)
class Model:
    """A linear model and what it is linearised about.

    Attributes:
        dynamics: its name in `formation_env.dynamics`.
        reference: radius that its mean motion is taken of, see `Orbit`.
    """

    dynamics: str
    reference: Literal["osculating", "mean"] = "osculating"


MODELS: Final = {
    "HCW": Model("hcw"),
    "modified HCW, osculating": Model("modified_hcw"),
    "modified HCW, mean": Model("modified_hcw", "mean"),
    "Yamanaka-Ankersen": Model("yamanaka_ankersen"),
}
FORMATIONS: Final[dict[str, Formation]] = {
    "following": Following(),
    "in-track": InTrack(),
    "x-y ellipse": XYEllipse(),
    "space circle": SpaceCircle(),
    "projected circle": ProjectedCircle(),
}
"""Those that close, as the thesis has them but for their size."""
CIRCULAR_ONLY: Final = ("in-track",)
SIZES_M: Final = (100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10e3, 20e3)
INCLINATIONS_DEG: Final = (0.0, 30.0, 45.0, 60.0, 75.0, 90.0, 97.8)
"""At 97.8 deg the orbit is Sun-synchronous."""
ECCENTRICITIES: Final = (0.0, 0.001, 0.003, 0.01, 0.1, 0.3)
SPANS: Final = (1, 10)
"""Orbits over which the error is looked at."""
INSTANTS: Final = 40
"""Per orbit."""
PERIGEE_M: Final = 600e3
_NO_AIR: Final = Spacecraft(air_density_kg_m3=0.0)


def leader(inclination_deg: float = 60.0, eccentricity: float = 0.0, j2: bool = True) -> Orbit:
    """The leader's orbit whose perigee is 600 km high."""
    semi_major_axis_m = (R_EARTH + PERIGEE_M) / (1 - eccentricity)
    return Orbit(
        altitude_m=semi_major_axis_m - R_EARTH, eccentricity=eccentricity, inclination_deg=inclination_deg, j2=j2
    )


def leaders() -> list[Orbit]:
    """All that are looked at: over the inclinations, and over the eccentricities with and without J2."""
    tilted = [leader(inclination_deg) for inclination_deg in INCLINATIONS_DEG]
    elliptic = [leader(eccentricity=e, j2=j2) for e in ECCENTRICITIES for j2 in (True, False)]
    return list(dict.fromkeys([*tilted, *elliptic]))


def sized(formation: Formation, orbit: Orbit, size_m: float) -> Array:
    """State (6,), m and m/s, of a formation whose greatest distance from the leader is size_m, by first order."""
    times_s = np.linspace(0, orbit.period_s, INSTANTS + 1)
    distance_m = np.linalg.norm(formation.reference(times_s, orbit)[:, :3], axis=1).max()
    return formation.state(orbit) * (size_m / distance_m)


def strayed(orbit: Orbit, states: Array) -> dict[str, Array]:
    """Greatest position errors of each model that knows such an orbit, over each of `SPANS`: (N, spans), m.

    Args:
        orbit: the leader's, as it is in the truth.
        states: LVLH states (N, 6) at t = 0 of truth and models, m and m/s.
    """
    times_s = orbit.period_s * np.arange(SPANS[-1] * INSTANTS + 1) / INSTANTS
    truth = propagate(states, times_s, dynamics=NONLINEAR, orbit=orbit, spacecraft=_NO_AIR)
    found = {}
    for name, model in MODELS.items():
        if model.reference == "osculating" or orbit.eccentricity == 0:
            believed = replace(orbit, mean_motion_from=model.reference)
            path = propagate(states, times_s, dynamics=model.dynamics, orbit=believed, spacecraft=_NO_AIR)
            error_m = np.linalg.norm((path - truth)[..., :3], axis=-1)
            found[name] = np.stack([error_m[:, : span * INSTANTS + 1].max(axis=1) for span in SPANS], axis=1)
    return found


@dataclass(frozen=True)
class Survey:
    """Errors of every model, formation and size about one leader; a `Job` of `baselines.experiments.parallel`.

    Attributes:
        orbit: the leader's.
        sizes_m: greatest distances from the leader, m.
    """

    orbit: Orbit
    sizes_m: Sequence[float] = SIZES_M

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law."""
        return 15_000

    def run(self, progress: Callable[[int], Any] = lambda _: None) -> pd.DataFrame:
        """One line per model, formation, size and span: j2, inclination_deg, eccentricity, those, error_m."""
        closed = closing(self.orbit)
        states = np.array(
            [sized(formation, self.orbit, size_m) for formation in closed.values() for size_m in self.sizes_m]
        )
        found = strayed(self.orbit, states)
        axes = {"model": found, "formation": closed, "size_m": self.sizes_m, "orbits": SPANS}
        index = pd.MultiIndex.from_product([list(values) for values in axes.values()], names=list(axes))
        lines = pd.DataFrame({"error_m": np.stack(list(found.values())).ravel()}, index).reset_index()
        for column in ("eccentricity", "inclination_deg", "j2"):
            lines.insert(0, column, getattr(self.orbit, column))
        progress(self.cost)
        return lines


def closing(orbit: Orbit) -> Mapping[str, Formation]:
    """The formations that close about such a leader."""
    circular = orbit.eccentricity == 0
    return {name: formation for name, formation in FORMATIONS.items() if circular or name not in CIRCULAR_ONLY}


def about(errors: pd.DataFrame, orbit: Orbit) -> pd.DataFrame:
    """Those lines of surveys that belong to a leader."""
    same = (errors["j2"] == orbit.j2) & (errors["inclination_deg"] == orbit.inclination_deg)
    return errors[same & (errors["eccentricity"] == orbit.eccentricity)]
