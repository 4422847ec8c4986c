"""Upper bounds of settings: beyond any spacecraft, and within them every number of an episode is finite."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from formation_env import ConfigError, FormationEnv, Scenario, Spacecraft
from formation_env import quantities as q
from formation_env.dropout import Bernoulli, GilbertElliott
from formation_env.formations import Following, SpaceCircle
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.task.observation import BOUND
from formation_env.task.phases import Limits, Phase, Start
from formation_env.task.scenario import Reward

STRONG = Spacecraft(max_accel_m_s2=q.MAX_ACCEL_M_S2, thrust_noise=q.MAX_THRUST_NOISE)
HEAVY_AIR = Spacecraft(
    mass_kg=q.MIN_MASS_KG,
    area_m2=q.MAX_AREA_M2,
    drag_coefficient=q.MAX_COEFFICIENT,
    radiation_coefficient=q.MAX_COEFFICIENT,
    air_density_kg_m3=q.MAX_DENSITY_KG_M3,
)
WIDE = Start(formation=Following(), initial_sigma_pos_m=q.MAX_DISTANCE_M, initial_sigma_vel_m_s=q.MAX_SPEED_M_S)
COSTLY = Reward(error_weight=q.MAX_ERROR_WEIGHT, transfer_error_weight=q.MAX_ERROR_WEIGHT)
STEEP = replace(COSTLY, error_cost="quadratic", quadratic_scale_m=q.MIN_ERROR_SCALE_M)
BLIND = Sensor(sigma_pos_m=q.MAX_DISTANCE_M, sigma_vel_m_s=q.MAX_SPEED_M_S)
UNBOUNDED = Limits(max_distance_m=q.MAX_DISTANCE_M)
VAGUE = KalmanFilter(
    sigma_pos_m=q.MAX_DISTANCE_M,
    sigma_vel_m_s=q.MAX_SPEED_M_S,
    process_noise_m_s2=q.MAX_ACCEL_M_S2,
    thrust_noise=q.MAX_THRUST_NOISE,
    initial_sigma_pos_m=q.MAX_DISTANCE_M,
    initial_sigma_vel_m_s=q.MAX_SPEED_M_S,
)
BASE = Scenario(
    start=Start(formation=Following()),
    phases=(Phase(formation=Following(), transfer_orbits=0.1, hold_orbits=0.1),),
    dropout=Bernoulli(loss_probability=0.2),
)
EXTREMES: dict[str, dict[str, Any]] = {
    "thrust": {"spacecraft": STRONG},
    "thrust and weights": {"spacecraft": STRONG, "reward": STEEP, "limits": UNBOUNDED},
    "start": {"start": WIDE},
    "start and weights": {"start": WIDE, "reward": COSTLY},
    "process noise": {"process_noise_m_s2": q.MAX_ACCEL_M_S2},
    "sensor": {"sensor": BLIND},
    "filter": {"filter": VAGUE},
    "tolerance": {"tolerance_m": q.MAX_DISTANCE_M},
    "dropout": {"dropout": GilbertElliott(mean_outage_s=q.MAX_DURATION_S, mean_uptime_orbits=q.MAX_ORBITS)},
    "all": {
        "spacecraft": STRONG,
        "start": WIDE,
        "process_noise_m_s2": q.MAX_ACCEL_M_S2,
        "sensor": BLIND,
        "filter": VAGUE,
        "reward": STEEP,
        "limits": UNBOUNDED,
    },
}


@pytest.mark.parametrize("extreme", EXTREMES)
@pytest.mark.parametrize("dynamics", ["modified_hcw", "nonlinear"])
def test_at_the_bounds_every_number_is_finite(extreme: str, dynamics: str) -> None:
    """Observations lie in their space and rewards are finite, at full and at random thrust, to the episode's end."""
    env = FormationEnv(replace(BASE, dynamics=dynamics, **EXTREMES[extreme]))
    generator = np.random.default_rng(0)
    for seed in range(4):
        observation, _ = env.reset(seed=seed)
        ended = False
        while not ended:
            assert np.abs(observation).max() <= BOUND
            action = np.ones(3, np.float32) if seed % 2 else generator.uniform(-1, 1, 3).astype(np.float32)
            observation, reward, terminated, truncated, _ = env.step(action)
            assert np.isfinite(observation).all()
            assert np.isfinite(reward)
            ended = terminated or truncated


def test_in_the_densest_air_the_linear_model_is_finite() -> None:
    """The thinnest sail in air a hundred times the densest: it brakes to a standstill within a step."""
    scenario = replace(BASE, spacecraft=HEAVY_AIR)
    model = scenario.true_dynamics()
    assert all(np.isfinite(part).all() for part in (model.Phi, model.Gamma, model.delta))


@pytest.mark.parametrize(
    ("cls", "key", "value"),
    [
        (Spacecraft, "max_accel_m_s2", 1e200),
        (Spacecraft, "min_accel_m_s2", 1e200),
        (Spacecraft, "thrust_noise", 1e155),
        (Spacecraft, "mass_kg", 1e-300),
        (Spacecraft, "area_m2", 1e300),
        (Spacecraft, "air_density_kg_m3", 1.2),
        (Start, "initial_sigma_pos_m", 1e100),
        (Start, "initial_sigma_vel_m_s", 1e100),
        (Sensor, "sigma_pos_m", 1e155),
        (Sensor, "sigma_vel_m_s", 1e155),
        (KalmanFilter, "process_noise_m_s2", 1e155),
        (Reward, "error_weight", 1e308),
        (Reward, "transfer_error_weight", 1e308),
        (Reward, "quadratic_scale_m", 1e-300),
        (Limits, "max_distance_m", 1e300),
        (Limits, "keep_out_m", 1e300),
        (Following, "y0_m", 1e300),
        (Following, "y0_m", -1e300),
        (SpaceCircle, "vx0_m_s", 1e300),
        (GilbertElliott, "mean_outage_s", 1e308),
        (GilbertElliott, "mean_uptime_orbits", 1e308),
    ],
)
def test_beyond_the_bounds_is_refused(cls: type, key: str, value: float) -> None:
    """One line with the class, the key, the bound and the value."""
    with pytest.raises(ConfigError, match=rf"^{cls.__name__}: {key}: must be (less|greater) than or equal to .*, got"):
        cls(**{key: value})


def test_scenarios_own_numbers_are_bounded_too() -> None:
    """Those that stand in no part."""
    for key, value in (("process_noise_m_s2", 1e200), ("tolerance_m", 1e200)):
        with pytest.raises(ConfigError, match=rf"^Scenario: {key}: must be less than or equal to"):
            replace(BASE, **{key: value})
