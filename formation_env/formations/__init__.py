"""Formations: force-free relative orbits. To add one: a file with a `Formation` subclass, and a line here."""

from typing import Annotated

from formation_env.formations.base import Formation
from formation_env.formations.ellipses import ProjectedCircle, SpaceCircle, XYEllipse
from formation_env.formations.in_track import InTrack
from formation_env.formations.leader import AtLeader
from formation_env.formations.lines import Following, Parallel
from formation_env.settings import OneOf

FORMATIONS: dict[str, type[Formation]] = {
    "at_leader": AtLeader,
    "following": Following,
    "parallel": Parallel,
    "xy_ellipse": XYEllipse,
    "in_track": InTrack,
    "space_circle": SpaceCircle,
    "projected_circle": ProjectedCircle,
}

AnyFormation = Annotated[Formation, OneOf(FORMATIONS)]

__all__ = [
    "FORMATIONS",
    "AnyFormation",
    "AtLeader",
    "Following",
    "Formation",
    "InTrack",
    "Parallel",
    "ProjectedCircle",
    "SpaceCircle",
    "XYEllipse",
]
