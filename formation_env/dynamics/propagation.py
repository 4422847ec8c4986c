"""Propagation of relative states without thrust."""

import numpy as np
from numpy.typing import ArrayLike

from formation_env.dynamics import NONLINEAR, check_truth, get_dynamics
from formation_env.dynamics.nonlinear import relative_path
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.dynamics.world import World
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit


def propagate(
    initial_state: ArrayLike,
    times_s: ArrayLike,
    *,
    dynamics: str = "modified_hcw",
    orbit: Orbit | None = None,
    spacecraft: Spacecraft | None = None,
    leader_spacecraft: Spacecraft | None = None,
    perturbations: Perturbations | None = None,
) -> Array:
    """Relative states of a follower that does not thrust: exact for a linear model, to a millimetre a day otherwise.

    Args:
        initial_state: LVLH states (..., 6) at t = 0: [x, y, z, x', y', z'], m and m/s.
        times_s: times (T,), s, in any order; negative ones run backwards.
        dynamics: name of a model in `formation_env.dynamics.DYNAMICS`, or `nonlinear`.
        orbit: the leader's orbit; the thesis's by default.
        spacecraft: the follower; the thesis's by default.
        leader_spacecraft: the leader; like the follower by default.
        perturbations: what acts in the nonlinear truth beside gravity.

    Returns:
        States (..., T, 6), m and m/s.

    Raises:
        ValueError: unknown model, wrong shape, a number that is not finite, unequal air densities, an elliptic orbit
            with a model of circular ones, perturbations with a linear model, or a spacecraft that re-enters.
    """
    states, times = np.asarray(initial_state, float), np.asarray(times_s, float)
    if states.ndim == 0 or states.shape[-1] != 6 or not np.isfinite(states).all():
        raise ValueError(f"initial_state must be finite with shape (..., 6), got shape {states.shape}: {states}")
    if times.ndim != 1 or not np.isfinite(times).all():
        raise ValueError(f"times_s must be finite with shape (T,), got shape {times.shape}: {times}")
    follower = spacecraft or Spacecraft()
    leader = leader_spacecraft or follower
    if leader.air_density_kg_m3 != follower.air_density_kg_m3:
        raise ValueError("leader_spacecraft.air_density_kg_m3: must be the follower's, they fly through the same air")
    orbit = orbit or Orbit()
    check_truth(dynamics, orbit, perturbations or Perturbations())
    if dynamics == NONLINEAR:
        return _nonlinear(states, times, World(orbit, perturbations or Perturbations()), follower, leader)
    model = get_dynamics(dynamics).discretise(0.0, times, orbit, follower, leader)
    path: Array = np.einsum("tij,...j->...ti", model.Phi, states) + model.delta
    return path


def _nonlinear(states: Array, times_s: Array, world: World, follower: Spacecraft, leader: Spacecraft) -> Array:
    """States (..., T, 6) of the nonlinear truth at times in any order."""
    path = np.empty((len(times_s), *states.shape))
    for sign, side in ((1.0, times_s >= 0), (-1.0, times_s < 0)):
        instants, places = np.unique(np.abs(times_s[side]), return_inverse=True)
        if len(instants):
            flown = relative_path(world, follower, leader, states.reshape(-1, 6), sign * instants)
            path[side] = flown[places].reshape(len(places), *states.shape)
    return np.moveaxis(path, 0, -2)
