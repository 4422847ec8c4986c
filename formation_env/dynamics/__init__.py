"""Models of the relative motion.

To add a linear one: a file with a `Dynamics` subclass and a line here, or `register_dynamics` from outside the package.
"""

from typing import Final

from formation_env.dynamics.base import DiscreteModel, Dynamics
from formation_env.dynamics.hcw import HCW
from formation_env.dynamics.modified_hcw import ModifiedHCW
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.printed_hcw import PrintedHCW
from formation_env.dynamics.yamanaka_ankersen import YamanakaAnkersen
from formation_env.orbital.orbit import Orbit
from formation_env.settings import nearest

DYNAMICS: dict[str, type[Dynamics]] = {
    "hcw": HCW,
    "modified_hcw": ModifiedHCW,
    "printed_hcw": PrintedHCW,
    "yamanaka_ankersen": YamanakaAnkersen,
}

NONLINEAR: Final = "nonlinear"
"""Name of the truth that is no linear model, see `formation_env.dynamics.nonlinear`."""


def register_dynamics(name: str, cls: type[Dynamics]) -> None:
    """Register a linear model under a name, so that scenarios may name it.

    Raises:
        ValueError: the class is no `Dynamics`, or another model has this name.
    """
    if not issubclass(cls, Dynamics):
        raise ValueError(f"{cls.__name__}: must inherit from Dynamics")
    if name == NONLINEAR or DYNAMICS.setdefault(name, cls) is not cls:
        raise ValueError(f"{cls.__name__}: a dynamics model named {name!r} exists already")


def get_dynamics(name: str) -> Dynamics:
    """The linear model of that name.

    Raises:
        ValueError: there is none of that name.
    """
    if name not in DYNAMICS:
        raise ValueError(f"dynamics: no model named {name!r}; {nearest(name, DYNAMICS)}")
    return DYNAMICS[name]()


def check_truth(name: str, orbit: Orbit, perturbations: Perturbations) -> None:
    """Refuse a truth that would leave out what other settings ask for.

    Raises:
        ValueError: perturbations or an elliptic orbit that the model of that name does not know, or no such model.
    """
    if name == NONLINEAR:
        return
    if perturbations != Perturbations():
        raise ValueError(f"perturbations: act in the truth nonlinear only, but dynamics is {name!r}")
    if orbit.eccentricity > 0 and get_dynamics(name).time_invariant:
        raise ValueError(
            f"dynamics: {name} is for circular orbits, got orbit.eccentricity = {orbit.eccentricity:g}; use "
            "yamanaka_ankersen or nonlinear"
        )


__all__ = [
    "DYNAMICS",
    "HCW",
    "NONLINEAR",
    "DiscreteModel",
    "Dynamics",
    "ModifiedHCW",
    "PrintedHCW",
    "YamanakaAnkersen",
    "check_truth",
    "get_dynamics",
    "register_dynamics",
]
