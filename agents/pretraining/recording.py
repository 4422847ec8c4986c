"""Disturbances of real episodes, recorded so that other controls can be simulated under exactly the same ones.

If truth and filter are one linear model, an episode's seed gives the same random accelerations, losses of measurements
and errors of the estimate whatever the thrust (separation principle). One flight without thrust records all of them.
`check_separation` refuses scenarios for which that does not hold.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.policy.features import REST
from formation_env.dynamics import NONLINEAR
from formation_env.envs import FormationVectorEnv
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario

SAME_MODEL_RTOL: Final = 1e-9
"""Relative difference of two models' entries that counts as rounding; modelling errors are larger by far."""


@dataclass(frozen=True)
class Recording:
    """Disturbances of episodes over T steps.

    Attributes:
        scenario: task that was flown.
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


def check_separation(scenario: Scenario) -> None:
    """Refuse a scenario in which disturbances or estimation errors depend on the thrust.

    Raises:
        ConfigError: naming the key and the value.
    """
    if scenario.dynamics == NONLINEAR:
        raise ConfigError("pretraining: the gradient through the model needs a linear truth; set updates: 0")
    if scenario.domain_randomization is not None:
        raise ConfigError(
            "domain_randomization: an episode is recorded of one variant; give one of draw_variants(scenario)"
        )
    filter_model = scenario.filter_model
    for key, value in (
        ("spacecraft.thrust_noise", scenario.spacecraft.thrust_noise),
        ("spacecraft.min_accel_m_s2", scenario.spacecraft.min_accel_m_s2),
        ("filter.thrust_noise", filter_model.thrust_noise),
    ):
        if value != 0:
            raise ConfigError(
                f"pretraining: the gradient through the model needs {key}: 0, got {value}: disturbances and estimation "
                "errors must not depend on the thrust; set updates: 0"
            )
    true, design = scenario.true_dynamics(), scenario.filter_dynamics()
    same = all(
        one.shape == other.shape and np.allclose(one, other, rtol=SAME_MODEL_RTOL, atol=0)
        for one, other in ((true.Phi, design.Phi), (true.Gamma, design.Gamma))
    )
    if not same:
        raise ConfigError(
            "pretraining: the gradient through the model needs a filter with the true dynamics, got "
            f"filter.dynamics: {filter_model.dynamics} for dynamics: {scenario.dynamics} or another filter.orbit: "
            "estimation errors must not depend on the thrust; set updates: 0"
        )


def record_disturbances(scenario: Scenario, seeds: Sequence[int]) -> Recording:
    """Fly one episode per seed without thrust.

    Raises:
        ConfigError: disturbances depend on the thrust (see `check_separation`), or an episode ended early.
    """
    check_separation(scenario)
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
