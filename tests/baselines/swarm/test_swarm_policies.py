"""Policies for several followers: architectures and avoidance, each against something that was not written here."""

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are
from scipy.optimize import minimize

from baselines import make_policy
from baselines.swarm.architectures import ARCHITECTURES
from baselines.swarm.assignment import assign, slot_costs
from baselines.swarm.avoidance import AVOIDANCE
from baselines.swarm.least_change import least_change
from baselines.swarm.planned_neighbours import by_plan
from baselines.swarm.policy import mean_error, neighbour_errors
from baselines.swarm.registry import make_swarm_policy
from formation_env import ConfigError, FormationSwarmEnv, FormationSwarmVectorEnv, load_scenario
from formation_env.dynamics.hcw import transition_matrix
from formation_env.numerics.arrays import Array
from formation_env.task.members import members
from formation_env.task.observation import SLICES, observation_layout

SWAP = load_scenario("swap")


def in_flight(steps: int = 20) -> tuple[FormationSwarmEnv, Array, dict[str, Any]]:
    """A swap some steps after its start under random thrust, with its observations and infos."""
    env = FormationSwarmEnv(SWAP)
    observations, info = env.reset(seed=7)
    generator = np.random.default_rng(0)
    for _ in range(steps):
        observations, _, _, _, info = env.step(0.2 * generator.uniform(-1, 1, (8, 3)))
    return env, observations, info


def test_the_neighbours_errors_are_their_own() -> None:
    """What a follower makes of its neighbours' messages is what these see themselves, where all hear each other."""
    env = FormationSwarmEnv("swap")
    observations, _ = env.reset(seed=0)
    own, others = neighbour_errors(observations, env.layout)
    for follower in range(8):
        every = np.vstack([own[follower], others[follower]])
        np.testing.assert_allclose(np.sort(every[:, 0]), np.sort(own[:, 0]), atol=0.02)  # who is not heard has its plan
    mean = mean_error(observations, env.layout)
    np.testing.assert_allclose(mean, np.broadcast_to(own.mean(axis=0), mean.shape), atol=0.02)


def test_mimo_is_the_regulator_of_the_stacked_state() -> None:
    """Two modes against scipy's solution for all followers at once, here three of them."""
    model = members(SWAP)[0][0].filter_dynamics()
    Phi, Gamma = model.Phi, model.Gamma
    count, coupling = 3, 0.3
    Q, R = np.diag([1.0, 1, 1, 1e4, 1e4, 1e4]), 1e6 * np.eye(3)
    differences = count * np.eye(count) - np.ones((count, count))
    P = solve_discrete_are(
        block_diag(*[Phi] * count),
        block_diag(*[Gamma] * count),
        np.kron(np.eye(count) + coupling * differences, Q),
        np.kron(np.eye(count), R),
    )
    A, B = block_diag(*[Phi] * count), block_diag(*[Gamma] * count)
    K = np.linalg.solve(np.kron(np.eye(count), R) + B.T @ P @ B, B.T @ P @ A)

    def gain(weights: Array) -> Array:
        mode = solve_discrete_are(Phi, Gamma, weights, R)
        return np.linalg.solve(R + Gamma.T @ mode @ Gamma, Gamma.T @ mode @ Phi)

    mean = np.full((count, count), 1 / count)
    split = np.kron(mean, gain(Q)) + np.kron(np.eye(count) - mean, gain((1 + count * coupling) * Q))
    np.testing.assert_allclose(split, K, rtol=1e-6, atol=1e-9 * np.abs(K).max())


def test_without_coupling_mimo_is_each_on_its_own() -> None:
    """And with it, the mean of the accelerations stays that of the mean error."""
    env, observations, _ = in_flight()
    alone = make_swarm_policy("leader_follower", SWAP).acceleration(observations[None])
    free = make_swarm_policy("mimo", SWAP, settings={"coupling": 0.0}).acceleration(observations[None])
    np.testing.assert_allclose(free, alone, atol=1e-9)
    law = make_policy("lqr", members(SWAP)[0][4])
    np.testing.assert_allclose(alone[0], law.acceleration(observations), atol=1e-12)
    coupled = make_swarm_policy("mimo", SWAP, settings={"coupling": 1.0}).acceleration(observations[None])
    assert np.abs(coupled - alone).max() > 1e-6
    assert env.layout.num_neighbours == 7


def test_a_rigid_displacement_is_left_to_the_structure() -> None:
    """A formation that is late and too small as a whole is corrected by the given share; other errors in full."""
    layout = observation_layout(SWAP)
    env = FormationSwarmEnv(SWAP)
    observations, _ = env.reset(seed=0)
    places = np.array([row[0].phases[0].formation.state(SWAP.orbit) for row in members(SWAP)[0:1][0:1]])
    slots = np.array([own.phases[0].formation.state(SWAP.orbit) for own in members(SWAP)[0]])
    assert len(places) == 1
    late = slots @ (transition_matrix(SWAP.orbit.mean_motion_rad_s, -5.0) - np.eye(6)).T - 0.02 * slots
    observations = hold(observations, layout, slots, late)
    half = make_swarm_policy("virtual_structure", SWAP, settings={"structure": 0.5}).acceleration(observations[None])
    halved = hold(observations, layout, slots, 0.5 * late)
    own = make_swarm_policy("leader_follower", SWAP).acceleration(halved[None])
    np.testing.assert_allclose(half, own, atol=0.01 * np.abs(own).max())


def hold(observations: Array, layout: Any, slots: Array, errors: Array) -> Array:
    """Observations of a group in hold, with these references and errors (followers, 6), all messages new."""
    from formation_env.task.observation import NEIGHBOUR_SIZE, NEIGHBOUR_SLICES, SIZE

    made = observations.copy()
    made[:, SLICES["error"]], made[:, SLICES["reference"]] = errors / layout.state_scale, slots / layout.state_scale
    made[:, SLICES["in_hold"]] = 1.0
    blocks = made[:, SIZE:].reshape(len(made), layout.num_neighbours, NEIGHBOUR_SIZE)
    for follower in range(len(made)):
        others = np.delete(np.arange(len(made)), follower)
        references = (slots[others] - slots[follower]) / layout.state_scale
        relative = (errors[others] - errors[follower]) / layout.state_scale
        blocks[follower, :, NEIGHBOUR_SLICES["relative_reference"]] = references
        blocks[follower, :, NEIGHBOUR_SLICES["relative_estimate"]] = references + relative
        blocks[follower, :, NEIGHBOUR_SLICES["present"]] = 1.0
        blocks[follower, :, NEIGHBOUR_SLICES["message_age"]] = 0.0
    return made


def test_the_least_change_is_that_of_a_quadratic_program() -> None:
    """Against scipy's SLSQP, with random half-spaces that some point within the limits satisfies."""
    generator = np.random.default_rng(0)
    for _ in range(20):
        normals = generator.normal(size=(4, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        inside, wanted = generator.uniform(-0.5, 0.5, 3), generator.uniform(-1, 1, 3)
        least = normals @ inside - generator.uniform(0, 0.3, 4)
        found = least_change(wanted, normals, least, np.ones(3), sweeps=2000)
        program = minimize(
            lambda a, wanted=wanted: np.sum((a - wanted) ** 2),
            inside,
            bounds=[(-1, 1)] * 3,
            constraints={"type": "ineq", "fun": lambda a, n=normals, b=least: n @ a - b},
            method="SLSQP",
            options={"ftol": 1e-12},
        )
        np.testing.assert_allclose(found, program.x, atol=1e-4)


@pytest.mark.parametrize("name", [*AVOIDANCE])
def test_two_on_one_course_keep_apart(name: str) -> None:
    """Two followers that would meet in the hold: without a layer they do, with one they pass at the least distance.

    True motion without noise; a tenth of the distance is allowed, since a barrier is kept at instants only.
    """
    scenario = replace(SWAP, process_noise_m_s2=0.0)
    env, policy = FormationSwarmEnv(scenario), make_swarm_policy("leader_follower", scenario, name)
    states = np.array([own.start.formation.state(own.orbit) for own in (members(SWAP)[i][i] for i in range(8))])
    gap = states[1, :3] - states[0, :3]
    for avoided in (False, True):
        begun = states.copy()
        begun[0, 3:] += gap / 500.0
        observations, info = env.reset(seed=0, options={"initial_state": begun, "slots": np.arange(8)})
        least = np.inf
        for _ in range(60):
            action = policy.predict(observations)[0] if avoided else np.zeros((8, 3), np.float32)
            observations, _, ended, _, info = env.step(action)
            least = min(least, info["least_distance_m"][:2].min())
            if ended:
                break
        assert (least > 0.9 * SWAP.safety.min_distance_m) == avoided


def test_a_neighbour_that_is_not_heard_flies_its_plan() -> None:
    """From the place of its last message to its slot by one impulse; against the closed form of HCW."""
    env, observations, _ = in_flight()
    layout, n = env.layout, SWAP.orbit.mean_motion_rad_s
    age_s = layout.neighbours(observations, "message_age")
    assert (age_s > 0).any()
    planned, known = by_plan(observations, layout), layout.neighbours(observations, "relative_estimate")
    np.testing.assert_array_equal(planned[age_s == 0], known[age_s == 0])
    own = layout.estimate(observations)[:, None]
    left_s = layout.time_to_arrival_s(observations)[0]
    at_arrival = (planned + own)[age_s > 0] @ transition_matrix(n, left_s).T
    slots = layout.state(observations, "reference")[:, None] + layout.neighbours(observations, "relative_reference")
    goals = slots[age_s > 0] @ transition_matrix(n, left_s).T
    # cross-track an impulse half an orbit before has no leverage; the other axes arrive
    np.testing.assert_allclose(at_arrival[:, :2], goals[:, :2], atol=1.0)


@pytest.mark.parametrize("name", ARCHITECTURES)
@pytest.mark.parametrize("avoidance", ["none", *AVOIDANCE])
def test_groups_are_flown_as_one_alone(name: str, avoidance: str) -> None:
    """A batch of observations gives what each gives, within the limits."""
    policy = make_swarm_policy(name, SWAP, avoidance)
    envs = FormationSwarmVectorEnv(3, SWAP)
    observations, _ = envs.reset(seed=0)
    actions, state = policy.predict(observations, state="kept")
    assert (actions.shape, actions.dtype, state) == ((3, 8, 3), np.float32, "kept")
    assert np.abs(actions).max() <= 1
    for group in range(3):
        np.testing.assert_allclose(policy.predict(observations[group])[0], actions[group], atol=1e-6)


def test_avoidance_saves_what_the_plain_law_violates() -> None:
    """Twenty swaps each on the same seeds: fewer steps too near, by far."""
    costs = {}
    for avoidance in ("none", "predictive"):
        policy, envs = make_swarm_policy("leader_follower", SWAP, avoidance), FormationSwarmVectorEnv(20, SWAP)
        observations, _ = envs.reset(seed=100)
        total = 0.0
        for _ in range(SWAP.num_steps - 1):
            observations, _, _, _, infos = envs.step(policy.predict(observations)[0])
            total += float(infos["cost"].sum())
        costs[avoidance] = total
    assert costs["none"] > 1000
    assert costs["predictive"] < 0.05 * costs["none"]


def test_slots_are_assigned_at_least_delta_v() -> None:
    """Against all orders; to coast on the circle, which leads half-way round, costs next to nothing (whole steps)."""
    scenario = replace(SWAP, followers=6, filter=replace(SWAP.filter, dynamics="hcw"), dynamics="hcw")
    costs = slot_costs(scenario)
    opposite = np.roll(np.arange(6), 3)
    assert costs[range(6), opposite].max() < 0.02 < 0.2 < costs[0, 0]
    assert assign(scenario).tolist() == opposite.tolist()
    order = [2, 0, 1, 4, 3, 5]
    moved = np.array([row[0].start.formation.state(scenario.orbit) for row in members(scenario)])[order]
    costs = slot_costs(scenario, moved)
    best = min(permutations(range(6)), key=lambda order: sum(costs[i, slot] for i, slot in enumerate(order)))
    assert assign(scenario, moved).tolist() == list(best) == opposite[order].tolist()


def test_a_hold_has_nothing_to_assign() -> None:
    """The message says so."""
    held = tuple(replace(phase, transfer_orbits=0.0) for phase in SWAP.phases)
    with pytest.raises(ValueError, match="none has a transfer"):
        slot_costs(replace(SWAP, phases=held))


def test_unknown_names_are_refused() -> None:
    """By a line that names the nearest."""
    with pytest.raises(ConfigError, match="no architecture named 'mino'; did you mean 'mimo'"):
        make_swarm_policy("mino", SWAP)
    with pytest.raises(ConfigError, match="no avoidance named 'cfb'; did you mean 'cbf'"):
        make_swarm_policy("mimo", SWAP, "cfb")
    with pytest.raises(ConfigError, match="predictive: margin_m: must be greater than or equal to 0"):
        make_swarm_policy("mimo", SWAP, "predictive", avoidance_settings={"margin_m": -1.0})
    with pytest.raises(ConfigError, match="avoidance: scp keeps apart by its plan"):
        make_swarm_policy("scp", SWAP, "cbf")
    with pytest.raises(ValueError, match=r"observation: must be \(8, 157\)"):
        make_swarm_policy("mimo", SWAP).predict(np.zeros((7, 157)))
