"""Open-loop prediction errors of the linear models against the nonlinear truth.

There is no drag, so the errors come from the oblateness, the leader's eccentricity and the distance. The perigee is
600 km high; at t = 0 the leader is there, at the ascending node.
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
class LinearModel:
    """A linear model and the radius of its mean motion.

    Attributes:
        dynamics: its name in `formation_env.dynamics`.
        mean_motion_from: radius that its mean motion is taken from, see `Orbit`.
    """

    dynamics: str
    mean_motion_from: Literal["osculating", "mean"] = "osculating"


MODELS: Final = {
    "HCW": LinearModel("hcw"),
    "modified HCW, osculating": LinearModel("modified_hcw"),
    "modified HCW, mean": LinearModel("modified_hcw", "mean"),
    "Yamanaka-Ankersen": LinearModel("yamanaka_ankersen"),
}
FORMATIONS: Final[dict[str, Formation]] = {
    "following": Following(),
    "in-track": InTrack(),
    "x-y ellipse": XYEllipse(),
    "space circle": SpaceCircle(),
    "projected circle": ProjectedCircle(),
}
"""The thesis's closed formations; sizes are set by `sized`."""
CIRCULAR_ONLY: Final = ("in-track",)
SIZES_M: Final = (100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10e3, 20e3)
INCLINATIONS_DEG: Final = (0.0, 30.0, 45.0, 60.0, 75.0, 90.0, 97.8)
"""At 97.8 deg the orbit is Sun-synchronous."""
ECCENTRICITIES: Final = (0.0, 0.001, 0.003, 0.01, 0.1, 0.3)
SPANS: Final = (1, 10)
"""Time spans of the error, in orbits."""
INSTANTS: Final = 40
"""Instants per orbit."""
PERIGEE_M: Final = 600e3
_NO_AIR: Final = Spacecraft(air_density_kg_m3=0.0)


def leader(inclination_deg: float = 60.0, eccentricity: float = 0.0, j2: bool = True) -> Orbit:
    """Leader's orbit with a perigee of 600 km."""
    semi_major_axis_m = (R_EARTH + PERIGEE_M) / (1 - eccentricity)
    return Orbit(
        altitude_m=semi_major_axis_m - R_EARTH, eccentricity=eccentricity, inclination_deg=inclination_deg, j2=j2
    )


def leaders() -> list[Orbit]:
    """Leader orbits of the survey: all inclinations, and all eccentricities with and without J2."""
    tilted = [leader(inclination_deg) for inclination_deg in INCLINATIONS_DEG]
    elliptic = [leader(eccentricity=e, j2=j2) for e in ECCENTRICITIES for j2 in (True, False)]
    return list(dict.fromkeys([*tilted, *elliptic]))


def sized(formation: Formation, orbit: Orbit, size_m: float) -> Array:
    """State (6,), m and m/s, of a formation scaled to a maximum distance of size_m from the leader (first order)."""
    times_s = np.linspace(0, orbit.period_s, INSTANTS + 1)
    distance_m = np.linalg.norm(formation.reference(times_s, orbit)[:, :3], axis=1).max()
    state: Array = formation.state(orbit) * (size_m / distance_m)
    return state


def prediction_errors(orbit: Orbit, states: Array) -> dict[str, Array]:
    """Maximum position errors of each applicable model over each of `SPANS`: (N, spans), m.

    Args:
        orbit: the leader's true orbit.
        states: LVLH states (N, 6) at t = 0 of truth and models, m and m/s.
    """
    times_s = orbit.period_s * np.arange(SPANS[-1] * INSTANTS + 1) / INSTANTS
    truth = propagate(states, times_s, dynamics=NONLINEAR, orbit=orbit, spacecraft=_NO_AIR)
    errors: dict[str, Array] = {}
    for name, model in MODELS.items():
        if model.mean_motion_from == "osculating" or orbit.eccentricity == 0:
            modelled = replace(orbit, mean_motion_from=model.mean_motion_from)
            path = propagate(states, times_s, dynamics=model.dynamics, orbit=modelled, spacecraft=_NO_AIR)
            error_m: Array = np.linalg.norm((path - truth)[..., :3], axis=-1)
            errors[name] = np.stack([error_m[:, : span * INSTANTS + 1].max(axis=1) for span in SPANS], axis=1)
    return errors


@dataclass(frozen=True)
class Survey:
    """Errors of every model, formation and size about one leader.

    Attributes:
        orbit: the leader's.
        sizes_m: greatest distances from the leader, m.
    """

    orbit: Orbit
    sizes_m: Sequence[float] = SIZES_M

    @property
    def cost(self) -> int:
        """Duration in steps of one law."""
        return 15_000

    def run(self, progress: Callable[[int], Any] = lambda _: None) -> pd.DataFrame:
        """Compute one line per model, formation, size and span: j2, inclination_deg, eccentricity, these, error_m."""
        closed = closing(self.orbit)
        states = np.array(
            [sized(formation, self.orbit, size_m) for formation in closed.values() for size_m in self.sizes_m]
        )
        errors = prediction_errors(self.orbit, states)
        axes = {"model": errors, "formation": closed, "size_m": self.sizes_m, "orbits": SPANS}
        index = pd.MultiIndex.from_product([list(values) for values in axes.values()], names=list(axes))
        lines = pd.DataFrame({"error_m": np.stack(list(errors.values())).ravel()}, index).reset_index()
        for column in ("eccentricity", "inclination_deg", "j2"):
            lines.insert(0, column, getattr(self.orbit, column))
        progress(self.cost)
        return lines


def closing(orbit: Orbit) -> Mapping[str, Formation]:
    """Formations that close about such a leader."""
    circular = orbit.eccentricity == 0
    return {name: formation for name, formation in FORMATIONS.items() if circular or name not in CIRCULAR_ONLY}


def about(errors: pd.DataFrame, orbit: Orbit) -> pd.DataFrame:
    """Select the lines of a leader."""
    same = (errors["j2"] == orbit.j2) & (errors["inclination_deg"] == orbit.inclination_deg)
    return errors[same & (errors["eccentricity"] == orbit.eccentricity)]
