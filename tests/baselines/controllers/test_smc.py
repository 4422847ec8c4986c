"""Sliding mode control with perfect knowledge: how it reaches its surface, and how it moves on it."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from oracles import hcw_state_matrix

from baselines import make_policy
from baselines.controllers.reaching import ConstantReaching, ExponentialReaching, PowerReaching
from baselines.controllers.surfaces import PlacedSurface
from formation_env import FormationVectorEnv, load_scenario
from formation_env.dropout import NoDropout
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.numerics.arrays import Array
from formation_env.task.phases import Start
from formation_env.task.scenario import Scenario

DT_S = 2.0
CE = np.hstack([np.diag([1.0, 0.8, 1.2]), np.diag([500.0, 600.0, 400.0])])
SURFACE = {"kind": "given", "position": [1.0, 0.8, 1.2], "velocity_s": [500.0, 600.0, 400.0]}
START_ERROR = np.array([61.3, -41.7, 30.9, 0.04, 0.02, -0.03])


@pytest.fixture(scope="module")
def perfect() -> Scenario:
    """Keeping with perfect measurements, no noise, force-free HCW truth, and thrust to spare."""
    keeping = load_scenario("keeping")
    return dataclasses.replace(
        keeping,
        dynamics="hcw",
        dt_s=DT_S,
        process_noise_m_s2=0.0,
        sensor=Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0),
        dropout=NoDropout(),
        spacecraft=Spacecraft(max_accel_m_s2=1.0),
        start=Start(formation=keeping.start.formation, initial_sigma_pos_m=1.0, initial_sigma_vel_m_s=1e-3),
    )


def fly(scenario: Scenario, gains: dict[str, Any], steps: int) -> Array:
    """True errors x_d - x (steps + 1, 6) from START_ERROR on."""
    policy = make_policy("smc", scenario, {"guidance": "automatic", **gains})
    env = FormationVectorEnv(1, scenario)
    reference = scenario.phases[0].formation.reference(DT_S * np.arange(steps + 1), scenario.orbit)
    observation, info = env.reset(seed=0, options={"initial_state": reference[0] - START_ERROR})
    states = [info["true_state"][0]]
    for _ in range(steps):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        states.append(info["true_state"][0])
    return reference - np.array(states)


# Law; time to the surface from s = s_0 in continuous time; the law's rate of s.
LAWS = {
    "constant": ({"eps_m_s": 0.1}, lambda s: s / 0.1, lambda s: 0.1),
    "exponential": (
        {"eps_m_s": 0.05, "q_per_s": 0.002},
        lambda s: np.log(1 + 0.002 * s / 0.05) / 0.002,
        lambda s: 0.05 + 0.002 * s,
    ),
    "power": ({"k_m_s": 0.02, "alpha": 0.5}, lambda s: 2 * np.sqrt(s) / 0.02, lambda s: 0.02 * np.sqrt(s)),
}


@pytest.mark.parametrize("kind", LAWS)
def test_surface_is_reached_when_the_law_says(perfect: Scenario, kind: str) -> None:
    """Time to the surface by integrating Ma 2009, eq. (4.53-4.55); then s stays within one step's chatter.

    The law steps along tangents, like Euler's method, which is ahead by dt / 2 log(first rate / last rate).
    """
    gains, time_s, rate = LAWS[kind]
    steps = 900
    errors = fly(perfect, {"surface": SURFACE, "reaching": {"kind": kind, **gains}, "boundary_m": 0.0}, steps)
    s = errors @ CE.T
    for axis in range(3):
        start = abs(s[0, axis])
        reached = DT_S * int(np.argmax(s[:, axis] * np.sign(s[0, axis]) <= 0))
        assert 0 < reached < 0.9 * DT_S * steps
        ahead_s = DT_S / 2 * np.log(rate(start) / rate(DT_S * rate(DT_S)))
        assert reached == pytest.approx(time_s(start) - ahead_s, abs=2 * DT_S)
        after = np.abs(s[int(reached / DT_S) + 1 :, axis])
        assert after.max() <= 2 * DT_S * rate(DT_S * rate(DT_S))


@pytest.mark.parametrize("boundary_m", [0.0, 20.0])
def test_surface_follows_the_discrete_law(perfect: Scenario, boundary_m: float) -> None:
    """s(k+1) = (I - q T) s(k) - eps T sgn s(k) (Ma 2009, eq. 4.56), with sat for sgn in the boundary layer.

    The actions and observations are single precision: 1e-7 of the thrust and of the kilometres in the reference.
    """
    eps, q = 0.03, 0.004
    reaching = {"kind": "exponential", "eps_m_s": eps, "q_per_s": q}
    s = fly(perfect, {"surface": SURFACE, "reaching": reaching, "boundary_m": boundary_m}, 200) @ CE.T
    expected = np.empty_like(s)
    expected[0] = CE @ START_ERROR
    for k in range(200):
        for axis in range(3):
            now = expected[k, axis]
            sign = np.sign(now) if boundary_m == 0 else min(max(now / boundary_m, -1.0), 1.0)
            expected[k + 1, axis] = now - q * DT_S * now - eps * DT_S * sign
    near = np.abs(expected) > 2 * eps * DT_S  # beyond, chattering depends on the last digit
    near |= boundary_m > 0
    np.testing.assert_allclose(np.where(near, s, 0), np.where(near, expected, 0), atol=1e-3)


def test_placed_surface_has_the_eigenvalues_asked_for(perfect: Scenario) -> None:
    """On the surface, x(k+1) = (I - G (Ce G)^-1 Ce) Phi x: three zeros, and exp(-decay dt) (Ma 2009, eq. 4.48)."""
    decay = (1e-3, 2e-3, 5e-4)
    for scenario in (perfect, dataclasses.replace(perfect, dynamics="modified_hcw", dt_s=30.0)):
        model = scenario.filter_dynamics()
        Ce = PlacedSurface(decay_per_s=decay).Ce(model, scenario.dt_s)
        sliding = model.Phi - model.Gamma @ np.linalg.solve(Ce @ model.Gamma, Ce @ model.Phi)
        expected = np.sort([0, 0, 0, *np.exp(-np.array(decay) * scenario.dt_s)])
        np.testing.assert_allclose(np.sort(np.linalg.eigvals(sliding).real), expected, atol=1e-6)


def test_placed_surface_slides_at_the_rate_asked_for(perfect: Scenario) -> None:
    """After the surface is reached, each axis' error decays by its own rate alone; 1 % for what is left of s."""
    decay = np.array([1e-3, 2e-3, 1.5e-3])
    gains = {
        "surface": {"kind": "placed", "decay_per_s": decay.tolist()},
        "reaching": {"kind": "exponential", "eps_m_s": 0.05, "q_per_s": 0.05},
        "boundary_m": 1.0,
    }
    errors = fly(perfect, gains, 400)
    first, last = 150, 400
    rates = -np.log(errors[last, :3] / errors[first, :3]) / (DT_S * (last - first))
    np.testing.assert_allclose(rates, decay, rtol=0.01)


REACHING_TIMES = {
    "constant": (ConstantReaching(eps_m_s=0.1), lambda s: s / 0.1),
    "exponential": (ExponentialReaching(eps_m_s=0.05, q_per_s=0.002), lambda s: np.log(1 + 0.002 * s / 0.05) / 0.002),
    "power 0.5": (PowerReaching(k_m_s=0.02, alpha=0.5), lambda s: s**0.5 / (0.5 * 0.02)),
    "power 0.3": (PowerReaching(k_m_s=0.05, alpha=0.3), lambda s: s**0.7 / (0.7 * 0.05)),
}


@pytest.mark.parametrize("law", REACHING_TIMES)
def test_reaching_times_are_the_theorys_for_short_steps(law: str) -> None:
    """|s| / eps, log(1 + q |s| / eps) / q and |s|^(1 - alpha) / ((1 - alpha) k) as the step goes to zero (4.53-4.55).

    What is left is the law's step along the tangent, at most a few steps near the surface and q dt on the way.
    """
    reaching, time_s = REACHING_TIMES[law]
    for start_m in (40.0, -15.0):
        expected = time_s(abs(start_m))
        for step_s in (1.0, 0.1, 0.02):
            s, steps = np.array([start_m]), 0
            while s[0] * start_m > 0:
                s, steps = s + reaching.change(s, np.sign(s), step_s), steps + 1
            assert step_s * steps == pytest.approx(expected, abs=6 * step_s)


PUSH_M_S2 = 4e-4


@pytest.fixture(scope="module")
def pushed(perfect: Scenario) -> Scenario:
    """The same with a constant push along-track that neither filter nor controller knows of: the leader's drag."""
    speed = perfect.orbit.speed_m_s
    area = 50.0 * PUSH_M_S2 / (0.5 * 1.04e-13 * speed**2)
    return dataclasses.replace(
        perfect,
        dynamics="modified_hcw",
        orbit=dataclasses.replace(perfect.orbit, j2=False),
        spacecraft=Spacecraft(max_accel_m_s2=1.0, area_m2=0.0),
        leader_spacecraft=Spacecraft(area_m2=area),
        # with process noise the filter goes on believing its perfect measurements
        filter=KalmanFilter(dynamics="hcw", process_noise_m_s2=1e-3),
    )


def test_relay_reaches_within_the_bounds_of_its_disturbance(pushed: Scenario) -> None:
    """s' = Ce A e - Ce_v (push + u0 sgn s) is reached after |s0| / (Ce_v u0 + F) to |s0| / (Ce_v u0 - F).

    F bounds the rest of s' on the way, by the HCW equations; the clock has steps. Then s chatters by what a step
    makes of u0.
    """
    u0 = 1e-3
    errors = fly(pushed, {"surface": SURFACE, "reaching": {"kind": "relay", "u0_m_s2": u0}, "boundary_m": 0.0}, 600)
    s, n = errors @ CE.T, pushed.orbit.mean_motion_rad_s
    rest = errors @ hcw_state_matrix(n).T @ CE.T - CE[:, 4] * PUSH_M_S2
    for axis in range(3):
        reached = int(np.argmax(s[:, axis] * np.sign(s[0, axis]) <= 0))
        assert reached > 0
        relay, bound = CE[axis, 3 + axis] * u0, np.abs(rest[:reached, axis]).max()
        start = abs(s[0, axis])
        assert start / (relay + bound) - DT_S < DT_S * reached < start / (relay - bound) + DT_S
        assert np.abs(s[reached:, axis]).max() < 2 * DT_S * (relay + np.abs(rest[reached:, axis]).max())


def test_relay_below_the_disturbance_never_arrives(pushed: Scenario) -> None:
    """Ma 2009, below eq. (4.23): the error decays only if u0 > f0: half of the push is too little along-track."""
    weak = {"kind": "relay", "u0_m_s2": PUSH_M_S2 / 2}
    s = fly(pushed, {"surface": SURFACE, "reaching": weak, "boundary_m": 0.0}, 300) @ CE.T
    assert (np.diff(s[:, 1]) < 0).all()
    assert s[-1, 1] < -0.25 * CE[1, 4] * PUSH_M_S2 * 300 * DT_S
    assert np.abs(s[-1, 2]) < 1


STANDSTILLS: dict[str, tuple[dict[str, Any], float]] = {
    "relay": ({"kind": "relay", "u0_m_s2": 1e-3}, 20 * PUSH_M_S2 / 1e-3),
    "constant": ({"kind": "constant", "eps_m_s": 0.9}, 20 * 600 * PUSH_M_S2 / 0.9),
    "exponential": ({"kind": "exponential", "eps_m_s": 0.5, "q_per_s": 0.01}, 600 * PUSH_M_S2 / (0.01 + 0.5 / 20)),
}


@pytest.mark.parametrize("kind", STANDSTILLS)
def test_a_push_shifts_the_surface_within_the_boundary_layer(pushed: Scenario, kind: str) -> None:
    """In the layer of 20 m, u0 s / Delta or Ce_v^-1 (q + eps / Delta) s balances the push: that is how thick it is.

    The push held over a step moves s by Ce_v dt + Ce_r dt^2 / 2: 1.3e-3 more. On the surface the
    error has settled after ten times its 750 s.
    """
    reaching, expected = STANDSTILLS[kind]
    s = fly(pushed, {"surface": SURFACE, "reaching": reaching, "boundary_m": 20.0}, 3750)[-1] @ CE.T
    assert s[1] == pytest.approx(-expected, rel=5e-3)
    assert np.abs(s[[0, 2]]).max() < 0.1
