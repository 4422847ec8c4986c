"""Chapter 3: formations as planned."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from baselines.thesis.figures import paths, style
from formation_env.formations import Following, Formation, InTrack
from formation_env.numerics.arrays import Array
from formation_env.orbital.constants import OMEGA_EARTH, R_EARTH
from formation_env.orbital.orbit import Orbit

_POINTS: Final = 721


def formation(planned: Formation) -> Figure:
    """A formation over one period from four sides: x-y, y-z and x-z, and in space."""
    orbit = Orbit()
    path = planned.reference(np.linspace(0.0, orbit.period_s, _POINTS), orbit)[:, :3]
    figure = style.sheet(7.6)
    for place, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), 1):
        axes = figure.add_subplot(2, 2, place)
        axes.plot(path[:, a], path[:, b], color=style.PLANNED, label="follower's trajectory")
        axes.plot(path[0, a], path[0, b], linestyle="none", marker="o", color=style.START, label="follower's start")
        axes.plot(0, 0, linestyle="none", marker="*", color="black", markersize=9, label="leader")
        axes.axis("equal")
        style.label(axes, f"{'xyz'[a]} [m]", f"{'xyz'[b]} [m]")
    style.legend(figure, axes)
    space: Any = figure.add_subplot(2, 2, 4, projection="3d")
    space.plot(*path.T, color=style.PLANNED)
    paths.point(space, path[0], "o", style.START, "follower's start")
    paths.point(space, np.zeros(3), "*", "black", "leader")
    paths.scales(space, np.vstack([path, np.zeros(3)]))
    return figure


def in_track() -> Figure:
    """Ground tracks of leader and in-track follower, and how far they miss each other."""
    orbit, planned = Orbit(), InTrack()
    times_s = np.linspace(0.0, orbit.period_s, _POINTS)
    figure = style.sheet(4.0)
    tracks, misses = figure.subplots(1, 2)
    for shown, look in ((np.zeros(6), {"color": style.DESIRED, "lw": 4.5, "label": "leader"}), (planned, {})):
        offset = shown if isinstance(shown, np.ndarray) else shown.reference(times_s, orbit)
        latitude, longitude = _degrees(ground(times_s, offset, orbit))
        jumps = np.abs(np.diff(longitude, append=longitude[-1])) > 180
        longitude[jumps] = np.nan
        tracks.plot(longitude, latitude, **({"color": style.PLANNED, "lw": 1.2, "label": "in-track follower"} | look))
    style.label(tracks, "Longitude [deg]", "Latitude [deg]")
    for follower, color, dash, name in (
        (planned, style.PLANNED, "-", "in-track follower"),
        (Following(y0_m=planned.y0_m), style.START, "--", "following, same separation"),
    ):
        misses.plot(times_s, miss_m(times_s, follower, planned.y0_m, orbit), color=color, linestyle=dash, label=name)
    style.label(misses, "Time [s]", "Distance between ground tracks [m]")
    handles, labels = tracks.get_legend_handles_labels()
    more, names = misses.get_legend_handles_labels()
    figure.legend([*handles, more[1]], [*labels, names[1]], loc="outside upper center", ncols=3)
    return figure


def ground(times_s: Array, offset: Array, orbit: Orbit) -> Array:
    """Points (n, 3) on the Earth below a follower, Earth-fixed, m; the leader is at its ascending node at t = 0.

    Args:
        times_s: (n,).
        offset: LVLH states of the follower (n, 6) or (6,), m.
        orbit: the leader's.
    """
    u = orbit.mean_motion_rad_s * times_s
    angles = np.stack([u, np.full_like(u, orbit.inclination_rad), -OMEGA_EARTH * times_s], axis=1)
    place = np.broadcast_to(offset, (len(times_s), 6))[:, :3] + [orbit.radius_m, 0.0, 0.0]
    # rotations about z, x, z: along the orbit, by the inclination, back by the Earth's turn
    turned = Rotation.from_euler("zxz", angles).apply(place)
    below: Array = R_EARTH * turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return below


def miss_m(times_s: Array, follower: Formation, ahead_m: float, orbit: Orbit) -> Array:
    """Distance (n,) of a follower's ground point from the leader's when the leader has come as far over ground, m."""
    over_ground_rad_s = orbit.mean_motion_rad_s - OMEGA_EARTH * np.cos(orbit.inclination_rad)
    later = times_s + ahead_m / (over_ground_rad_s * orbit.radius_m)
    gap = ground(times_s, follower.reference(times_s, orbit), orbit) - ground(later, np.zeros(6), orbit)
    return np.asarray(np.linalg.norm(gap, axis=1))


def _degrees(places: Array) -> tuple[Array, Array]:
    """Latitudes and longitudes (n,), deg."""
    x, y, z = places.T
    return np.degrees(np.arcsin(z / R_EARTH)), np.degrees(np.arctan2(y, x))
