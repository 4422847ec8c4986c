"""Models of the relative motion. To add one: a file with a class that has `Dynamics`' methods, and a line here."""

from formation_env.dynamics.base import DiscreteModel, Dynamics, discretise
from formation_env.dynamics.hcw import HCW, transition_matrix
from formation_env.dynamics.modified_hcw import ModifiedHCW
from formation_env.dynamics.printed_hcw import PrintedHCW
from formation_env.settings import nearest

DYNAMICS: dict[str, type[Dynamics]] = {"hcw": HCW, "modified_hcw": ModifiedHCW, "printed_hcw": PrintedHCW}


def get_dynamics(name: str) -> Dynamics:
    """The dynamics model of that name.

    Raises:
        ValueError: there is none of that name.
    """
    if name not in DYNAMICS:
        raise ValueError(f"dynamics: no model named {name!r}; {nearest(name, DYNAMICS)}")
    return DYNAMICS[name]()


__all__ = [
    "DYNAMICS",
    "HCW",
    "DiscreteModel",
    "Dynamics",
    "ModifiedHCW",
    "PrintedHCW",
    "discretise",
    "get_dynamics",
    "transition_matrix",
]
