"""Formations: force-free relative orbits.

To add one: a file with a `Formation` subclass and a line here, or `register_formation` from outside the package.
"""

from typing import Annotated, TypeVar

from formation_env.formations.base import FORMATIONS, Formation
from formation_env.formations.ellipses import ProjectedCircle, SpaceCircle, XYEllipse
from formation_env.formations.in_track import InTrack
from formation_env.formations.leader import AtLeader
from formation_env.formations.lines import Following, Parallel
from formation_env.formations.listed import Listed
from formation_env.formations.train import Train
from formation_env.settings import OneOf, register

F = TypeVar("F", bound=Formation)

_KINDS: dict[str, type[Formation]] = {
    "at_leader": AtLeader,
    "following": Following,
    "parallel": Parallel,
    "xy_ellipse": XYEllipse,
    "in_track": InTrack,
    "space_circle": SpaceCircle,
    "projected_circle": ProjectedCircle,
    "train": Train,
    "list": Listed,
}
FORMATIONS.update(_KINDS)

AnyFormation = Annotated[Formation, OneOf(FORMATIONS)]


def register_formation(cls: type[F]) -> type[F]:
    """Register a formation under its `kind`, so that scenario files may name it; usable as a decorator.

    Args:
        cls: a `Formation` subclass made with `settings`, with a field such as `kind: Literal["ring"] = "ring"`.

    Raises:
        ValueError: the class is no such subclass, or another formation has this kind.
    """
    register(FORMATIONS, cls, Formation)
    return cls


__all__ = [
    "FORMATIONS",
    "AnyFormation",
    "AtLeader",
    "Following",
    "Formation",
    "InTrack",
    "Listed",
    "Parallel",
    "ProjectedCircle",
    "SpaceCircle",
    "Train",
    "XYEllipse",
    "register_formation",
]
