"""Groups of followers: slots, links between followers, messages, and the ends of episodes."""

from dataclasses import replace

import numpy as np
import pytest

from formation_env import FormationSwarmEnv, FormationSwarmVectorEnv, Scenario, load_scenario, parallel_env
from formation_env.dropout import GilbertElliott, NoDropout, Windows
from formation_env.dropout.windows import Window
from formation_env.dynamics.base import CROSS_TRACK, IN_PLANE
from formation_env.navigation.filter_settings import process_noise_covariance
from formation_env.numerics.arrays import Array
from formation_env.task.followers import InterSatelliteLink
from formation_env.task.members import members
from formation_env.task.observation import SIGMA_UNIT_POS_M

HOLD_STILL = np.zeros((8, 3), np.float32)


def linked(link: InterSatelliteLink, name: str = "swap") -> Scenario:
    """A shipped scenario with other links between followers."""
    return replace(load_scenario(name), inter_satellite_link=link)


def covariances(env: FormationSwarmEnv) -> Array:
    """Covariances (followers, 6, 6) of the filters."""
    simulation = env.simulation
    P = np.zeros((simulation.count, 6, 6))
    for name, axes in (("covariance_in_plane", IN_PLANE), ("covariance_cross_track", CROSS_TRACK)):
        values = simulation.by_group(simulation.read(name))[0]
        rows, columns = np.triu_indices(len(axes))
        P[:, axes[rows], axes[columns]] = P[:, axes[columns], axes[rows]] = values
    return P


@pytest.mark.parametrize("name", ["swap", "swarm_nonlinear"])
def test_a_message_is_propagated_while_the_link_is_down(name: str) -> None:
    """By the sender's model without thrust: estimate and covariance, against matrices written here.

    Single precision in units of L, some km: half a millimetre, and as much of the velocities' unit.
    """
    closed = Windows(windows=(Window(start_s=300.0, duration_s=600.0),))
    env = FormationSwarmEnv(linked(InterSatelliteLink(dropout=closed), name))
    scenario = members(env.scenario)[0][0]
    model, dt_s = scenario.filter_dynamics(), scenario.dt_s
    Q_noise = process_noise_covariance(model.Gamma, scenario.filter_model.process_noise_m_s2)
    observations, info = env.reset(seed=4)
    actions = np.random.default_rng(0)
    sent, P, age_s = info["estimate"], covariances(env), 0.0
    for step in range(1, 35):
        action = actions.uniform(-1, 1, (env.scenario.followers, 3)).astype(np.float32)
        observations, _, _, _, info = env.step(action)
        if 300 <= step * dt_s < 900:
            sent, P, age_s = sent @ model.Phi.T + model.delta, model.Phi @ P @ model.Phi.T + Q_noise, age_s + dt_s
        else:
            sent, P, age_s = info["estimate"], covariances(env), 0.0
        own, own_P = info["estimate"], covariances(env)
        seen = env.layout.neighbours(observations, "relative_estimate")
        sigmas_m = env.layout.neighbours(observations, "relative_sigma_pos")
        np.testing.assert_allclose(env.layout.neighbours(observations, "message_age"), age_s, rtol=1e-4, atol=1e-3)
        for follower in range(env.scenario.followers):
            for line, sigma_m in zip(seen[follower], sigmas_m[follower], strict=True):
                distances = np.linalg.norm((sent - own[follower] - line)[:, :3], axis=1)
                sender = distances.argmin()
                assert distances[sender] < 2e-3
                np.testing.assert_allclose(line[3:], (sent[sender] - own[follower])[3:], atol=2e-6)
                variance = np.trace((P[sender] + own_P[follower])[:3, :3]) / 3
                assert sigma_m == pytest.approx(np.sqrt(variance) * SIGMA_UNIT_POS_M, rel=1e-4)


def test_nothing_is_heard_beyond_the_range() -> None:
    """A message is new exactly where the true distance is within the range."""
    env = FormationSwarmEnv(linked(InterSatelliteLink(range_m=700.0, dropout=NoDropout())))
    observations, info = env.reset(seed=0)
    for step in range(20):
        positions = info["true_state"][:, :3]
        within = np.linalg.norm(positions[:, None] - positions, axis=-1) <= 700.0
        heard = env.layout.neighbours(observations, "message_age") == 0.0
        others = within.sum(axis=1) - 1 if step else 7  # the age of what was never heard begins at the start
        np.testing.assert_array_equal(heard.sum(axis=1), others)
        observations, _, _, _, info = env.step(HOLD_STILL)


def test_a_message_never_heard_is_the_plan() -> None:
    """At the start, whoever is not heard is where the plan has it; then it coasts from there."""
    scenario = linked(InterSatelliteLink(range_m=1.0, dropout=NoDropout()))
    env = FormationSwarmEnv(replace(scenario, slots="fixed"))
    observations, info = env.reset(seed=0)
    planned = np.array([own.start.formation.state(own.orbit) for own, *_ in members(env.scenario)])
    for follower, lines in enumerate(env.layout.neighbours(observations, "relative_estimate")):
        known = np.sort((lines + info["estimate"][follower])[:, 1])
        np.testing.assert_allclose(known, np.sort(np.delete(planned, follower, axis=0)[:, 1]), atol=2e-3)


def test_links_are_up_as_often_as_their_chain_says() -> None:
    """Gilbert-Elliott: the share of lost messages, within five standard errors for pairs and groups, at any instant."""
    dropout = GilbertElliott(mean_outage_s=600.0, mean_uptime_orbits=0.25)
    env = FormationSwarmVectorEnv(200, linked(InterSatelliteLink(dropout=dropout)))
    loss = dropout.chain(env.scenario.dt_s, env.scenario.orbit).stationary_loss
    observations, _ = env.reset(seed=0)
    for step in range(2):
        lost = np.mean(env.layout.neighbours(observations, "message_age") > 0.0) if step else loss
        assert abs(lost - loss) < 5 * np.sqrt(loss * (1 - loss) / (200 * 28))
        for _ in range(40):
            observations, *_ = env.step(np.zeros(env.action_space.shape, np.float32))  # type: ignore[arg-type]


def test_slots_are_drawn_evenly() -> None:
    """Each follower flies in each slot equally often, within five standard errors."""
    env = FormationSwarmVectorEnv(800, "swap")
    _, infos = env.reset(seed=0)
    slots = infos["slots"]
    np.testing.assert_array_equal(np.sort(slots, axis=1), np.tile(np.arange(8), (800, 1)))
    counts = np.array([np.bincount(column, minlength=8) for column in slots.T])
    assert abs(counts - 100).max() < 5 * np.sqrt(100 * 7 / 8)


def colliding(ends: str) -> tuple[Scenario, Array]:
    """Swap with followers 0 and 1 on a course that meets half-way through the third step, and where all start."""
    scenario = load_scenario("swap")
    scenario = replace(
        scenario, process_noise_m_s2=0.0, safety=replace(scenario.safety, ends=ends, collision_distance_m=60.0)
    )  # type: ignore[arg-type]
    starts = np.array([own.start.formation.state(own.orbit) for own in (members(scenario)[i][i] for i in range(8))])
    gap = starts[1, :3] - starts[0, :3]
    starts[0, 3:], starts[1, 3:] = gap / (5 * scenario.dt_s), -gap / (5 * scenario.dt_s)
    return scenario, starts


def test_a_collision_ends_the_group() -> None:
    """All followers end with the first collision, which both who collide see between two steps."""
    scenario, starts = colliding("group")
    env = FormationSwarmEnv(scenario)
    env.reset(seed=0, options={"initial_state": starts, "slots": np.arange(8)})
    ends = [env.step(HOLD_STILL) for _ in range(3)]
    assert [terminated for _, _, terminated, _, _ in ends] == [False, False, True]
    info = ends[-1][4]
    assert (info["least_distance_m"][:2] < scenario.safety.collision_distance_m).all()
    assert (info["least_distance_m"][2:] > scenario.safety.collision_distance_m).all()
    assert (info["exit_cost_m_s"] > 0).all()
    assert info["episode_totals"]["cost"].max() >= 1


def test_a_collision_ends_two_followers() -> None:
    """The others fly on and see them no more; their totals stay as they were."""
    scenario, starts = colliding("follower")
    env = FormationSwarmEnv(scenario)
    env.reset(seed=0, options={"initial_state": starts, "slots": np.arange(8)})
    ended, steps, totals = False, 0, np.zeros(0)
    while not ended:
        observations, _, terminated, truncated, info = env.step(HOLD_STILL)
        ended, steps = terminated or truncated, steps + 1
        present = env.layout.neighbours(observations, "present")
        if steps == 3:
            totals = env.simulation.by_group(env.simulation.read("sum_reward"))[0]
        assert (present.sum(axis=1)[2:] == (7 if steps < 3 else 5)).all()
        assert (info["present"][:2] == (steps < 3)).all()
        if steps > 3:
            assert not info["reward"][:2].any()
            assert not info["cost"][:2].any()
            assert (info["reward"][2:] <= 0).all()
    assert steps == scenario.num_steps
    np.testing.assert_array_equal(info["episode_totals"]["return"][:2], totals[:2])
    assert (info["episode_totals"]["steps"] == [3, 3, *[steps] * 6]).all()


def test_agents_leave_after_a_collision() -> None:
    """PettingZoo's face: two agents end, the others remain to the end."""
    scenario, starts = colliding("follower")
    env = parallel_env(scenario)
    env.reset(seed=0, options={"initial_state": starts, "slots": np.arange(8)})
    for _ in range(3):
        _, _, terminations, _, infos = env.step(dict.fromkeys(env.agents, HOLD_STILL[0]))
    assert [name for name, ended in terminations.items() if ended] == ["follower_0", "follower_1"]
    assert len(infos) == 8
    assert env.agents == [f"follower_{index}" for index in range(2, 8)]
    observations, *_ = env.step(dict.fromkeys(env.agents, HOLD_STILL[0]))
    assert list(observations) == env.agents


def test_neighbours_are_the_nearest_to_come() -> None:
    """With fewer neighbours than there are others, an observation shows the first of all, in the same order."""
    scenario = load_scenario("swap")
    every, few = FormationSwarmEnv(scenario), FormationSwarmEnv(replace(scenario, neighbours=3))
    (all_seen, _), (seen, _) = every.reset(seed=3), few.reset(seed=3)
    for _ in range(3):
        np.testing.assert_array_equal(all_seen[:, : few.layout.size], seen)
        distances = every.layout.neighbours(all_seen, "closest_distance")
        assert (np.diff(distances, axis=1) >= 0).all()
        all_seen, seen = every.step(HOLD_STILL)[0], few.step(HOLD_STILL)[0]
