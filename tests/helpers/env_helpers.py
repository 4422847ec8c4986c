"""What the tests of the environments share: small scenarios, flights, and references of their own."""

import dataclasses
from typing import Any

import numpy as np
import oracles
from numpy.typing import NDArray
from oracles import hcw_state_matrix
from scipy.linalg import expm

from formation_env import FormationEnv, FormationVectorEnv, Scenario, load_scenario
from formation_env.dropout import Dropout, NoDropout
from formation_env.navigation.sensor import Sensor
from formation_env.task.phases import Limits, Start

Array = NDArray[np.float64]

MU, R_EARTH = 3.986004391e14, 6378136.6
"""Ma 2009, Table 5.1."""


def noise_free(name: str, dropout: Dropout = NoDropout()) -> Scenario:  # noqa: B008, settings are frozen
    """A shipped scenario in which nothing is random and the filter starts at the truth."""
    scenario = load_scenario(name)
    start = dataclasses.replace(scenario.start, initial_sigma_pos_m=0.0, initial_sigma_vel_m_s=0.0)
    sensor = Sensor(sigma_pos_m=0.0, sigma_vel_m_s=0.0)
    return dataclasses.replace(scenario, start=start, sensor=sensor, process_noise_m_s2=0.0, dropout=dropout)


def restless(max_distance_m: float = 800.0) -> Scenario:
    """A short flight with limits so near that random actions end episodes at many different steps."""
    scenario = load_scenario("keeping")
    phases = tuple(dataclasses.replace(phase, hold_orbits=0.15) for phase in scenario.phases)
    start = dataclasses.replace(scenario.start, initial_sigma_pos_m=200.0, initial_sigma_vel_m_s=0.5)
    return dataclasses.replace(scenario, phases=phases, start=start, limits=Limits(max_distance_m=max_distance_m))


def start_spread(pos_m: float, vel_m_s: float, scenario: Scenario) -> Scenario:
    """The scenario with another spread of its start."""
    start: Start = dataclasses.replace(scenario.start, initial_sigma_pos_m=pos_m, initial_sigma_vel_m_s=vel_m_s)
    return dataclasses.replace(scenario, start=start)


def random_actions(seed: int, *shape: int) -> NDArray[np.float32]:
    """Uniform actions (*shape, 3) from the whole action space."""
    return np.random.default_rng(seed).uniform(-1, 1, (*shape, 3)).astype(np.float32)


def fly(env: FormationEnv, actions: NDArray[np.float32], **reset: Any) -> list[tuple[Any, ...]]:
    """Everything that reset and the steps return; it stops where the episode ends."""
    results: list[tuple[Any, ...]] = [env.reset(**reset)]
    for action in actions:
        results.append(env.step(action))
        if results[-1][2] or results[-1][3]:
            break
    return results


def fly_rows(env: FormationVectorEnv, actions: NDArray[np.float32], **reset: Any) -> list[tuple[Any, ...]]:
    """Fly a batch, with actions (steps, rows, 3)."""
    return [env.reset(**reset), *(env.step(action) for action in actions)]


def assert_same(left: Any, right: Any, where: str = "") -> None:
    """Both sides agree bit for bit, with types, dtypes and shapes, down through tuples and dicts."""
    assert type(left) is type(right), f"{where}: {type(left)} and {type(right)}"
    if isinstance(left, dict):
        assert set(left) == set(right), f"{where}: keys differ by {set(left) ^ set(right)}"
        for key in left:
            assert_same(left[key], right[key], f"{where}.{key}")
    elif isinstance(left, (tuple, list)) or (isinstance(left, np.ndarray) and left.dtype == object):
        assert len(left) == len(right), where
        for index, (a, b) in enumerate(zip(left, right, strict=True)):
            assert_same(a, b, f"{where}[{index}]")
    elif isinstance(left, np.ndarray):
        assert (left.dtype, left.shape) == (right.dtype, right.shape), where
        assert left.tobytes() == right.tobytes(), f"{where}: {left} and {right}"
    else:
        assert left == right, f"{where}: {left} and {right}"


def spoil(outputs: Any) -> None:
    """Overwrite all arrays in nested tuples and dicts."""
    if isinstance(outputs, np.ndarray) and outputs.dtype != object:
        outputs[...] = True if outputs.dtype == bool else 77
    elif isinstance(outputs, dict):
        for value in outputs.values():
            spoil(value)
    elif isinstance(outputs, (tuple, list, np.ndarray)):
        for value in outputs:
            spoil(value)


def row_of(results: tuple[Any, ...], row: int) -> tuple[Any, ...]:
    """One row of what a batch's reset or step returned, in a single environment's form but for the infos' types."""
    *arrays, infos = results
    return *(array[row] for array in arrays), {k: v[row] for k, v in infos.items() if k[0] != "_" and k[:5] != "final"}


def mean_motion(scenario: Scenario) -> float:
    """The rate n of the reference, rad/s: of the leader's radius, or of its mean radius under J2 (Brouwer 1959)."""
    orbit = scenario.orbit
    a = R_EARTH + orbit.altitude_m
    radius = a
    if orbit.mean_motion_from == "mean":
        q, i = oracles.J2 * R_EARTH**2 / a, np.radians(orbit.inclination_deg)
        u = np.radians(orbit.arg_perigee_deg + orbit.true_anomaly_deg)
        radius = a - 1.5 * q * np.sin(i) ** 2 * np.cos(2 * u) + 0.75 * q * (1 - 3 * np.cos(i) ** 2)
    return float(np.sqrt(MU / radius**3))


def coast(state: Array, time_s: float, scenario: Scenario) -> Array:
    """Force-free HCW motion, forwards or backwards, by the matrix exponential."""
    result: Array = expm(hcw_state_matrix(mean_motion(scenario)) * time_s) @ state
    return result


def path(state: Array, steps: int, scenario: Scenario) -> list[Array]:
    """Force-free HCW motion over 0 to `steps` steps."""
    step, states = expm(hcw_state_matrix(mean_motion(scenario)) * scenario.dt_s), [state]
    for _ in range(steps):
        states.append(step @ states[-1])
    return states


def steps_of(periods: float, scenario: Scenario) -> int:
    """The nearest number of whole steps."""
    return int(np.floor(periods * 2 * np.pi / mean_motion(scenario) / scenario.dt_s + 0.5))


@dataclasses.dataclass(frozen=True)
class Instant:
    """What the plan asks at the end of one step."""

    phase: int
    held: bool
    reference: Array


def plan(scenario: Scenario) -> list[Instant]:
    """What the step to each instant is judged by, written out anew: element 0 is the start."""
    instants: list[Instant] = []
    end = 0
    for index, phase in enumerate(scenario.phases):
        start, arrival = end, end + steps_of(phase.transfer_orbits, scenario)
        end = arrival + steps_of(phase.hold_orbits, scenario)
        target = np.asarray(phase.formation.state(scenario.orbit))
        first = coast(target, (start - arrival) * scenario.dt_s, scenario)
        states = path(first, end - start, scenario)
        skipped = 0 if index == 0 else 1
        instants += [Instant(index, start + k > arrival, state) for k, state in enumerate(states) if k >= skipped]
    return instants


def covariances(env: FormationVectorEnv) -> Array:
    """The filters' covariances (rows, 6, 6), put together from their two independent parts."""
    P = np.zeros((env.num_envs, 6, 6))
    for axes, name in (((0, 1, 3, 4), "covariance_in_plane"), ((2, 5), "covariance_cross_track")):
        upper = np.triu_indices(len(axes))
        block = np.zeros((env.num_envs, len(axes), len(axes)))
        block[:, upper[0], upper[1]] = env.simulation.read(name)
        block[:, upper[1], upper[0]] = block[:, upper[0], upper[1]]
        P[np.ix_(range(env.num_envs), axes, axes)] = block
    return P
