"""Disturbances of real episodes, recorded so that other controls can be tried under the very same ones.

Truth and filter are linear: whatever the thrust, an episode's seed gives the same random accelerations, losses of
measurements, and errors of the estimate (the separation principle). One flight without thrust tells them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.policy.features import REST
from formation_env.dynamics import NONLINEAR
from formation_env.envs import FormationVectorEnv
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario


@dataclass(frozen=True)
class Recording:
    """Episodes' disturbances over T steps.

    Attributes:
        scenario: what was flown.
        starts: true states at the start (rows, 6), m and m/s.
        pushes: effect of the random accelerations on the state in each step (T, rows, 6), m and m/s.
        estimate_errors: estimated less true states (T, rows, 6), m and m/s.
        rest: the block `REST` of the observations (T, rows, ...).
    """

    scenario: Scenario
    starts: Array
    pushes: Array
    estimate_errors: Array
    rest: NDArray[np.float32]


def record_disturbances(scenario: Scenario, seeds: Sequence[int]) -> Recording:
    """Fly one episode per seed without thrust.

    Raises:
        ConfigError: the truth is nonlinear, so that disturbances and thrust do not simply add up, or differs from
            episode to episode, or an episode ended early.
    """
    if scenario.dynamics == NONLINEAR:
        raise ConfigError("pretraining: the gradient through the model needs a linear truth; set updates: 0")
    if scenario.domain_randomization is not None:
        raise ConfigError(
            "domain_randomization: an episode is recorded of one variant; give one of draw_variants(scenario)"
        )
    env, steps, rows = FormationVectorEnv(len(seeds), scenario), scenario.num_steps, len(seeds)
    states, errors = np.empty((steps + 1, rows, 6)), np.empty((steps, rows, 6))
    rest = np.empty((steps, rows, SIZE - REST.start), np.float32)
    observations, infos = env.reset(seed=list(seeds))
    coast = np.zeros((rows, 3), np.float32)
    for step in range(steps):
        states[step], errors[step] = infos["true_state"], infos["estimate"] - infos["true_state"]
        rest[step] = observations[:, REST]
        observations, _, terminated, _, infos = env.step(coast)
        if terminated.any():
            raise ConfigError("pretraining: an episode without thrust ends early; widen limits.max_distance_m")
    states[steps] = infos["final_info"]["true_state"]
    model = scenario.true_dynamics()
    free = np.einsum("...ij,...rj->...ri", model.Phi, states[:-1]) + model.delta[..., None, :]
    return Recording(scenario, states[0], states[1:] - free, errors, rest)
