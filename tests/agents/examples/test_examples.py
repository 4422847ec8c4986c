"""The examples run, and do what they say."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import RolloutBuffer
from torch import Tensor
from typer.testing import CliRunner

from agents.examples import ppo, random_search
from formation_env.evaluation.seeds import seeds

ROWS, LENGTH = 8, 40


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer and shorter flights than the example's."""
    for name, value in {"ROWS": ROWS, "LENGTH": LENGTH, "BATCH": 80}.items():
        monkeypatch.setattr(ppo, name, value)


def flown(agent: ppo.Agent) -> ppo.Rollout:
    env = gymnasium.make_vec("FormationKeeping-v0", ROWS, vectorization_mode="vector_entry_point")
    rollout, observations = ppo.fly(env, agent, env.reset(seed=seeds("training", ROWS)[0])[0])
    assert observations.shape == (ROWS, 38)
    return rollout


def sb3_advantages(rewards: Tensor, values: Tensor, next_values: Tensor, ended: Tensor) -> np.ndarray:
    """The same by SB3's buffer, which wants the value after an end inside the last reward."""
    length, rows = rewards.shape
    buffer = RolloutBuffer(length, spaces.Box(-1, 1, (1,)), spaces.Box(-1, 1, (1,)), "cpu", ppo.LAMBDA, ppo.GAMMA, rows)
    starts = torch.cat([torch.ones(1, rows), ended[:-1].float()])
    inside = rewards + ppo.GAMMA * next_values * ended
    nothing = np.zeros((rows, 1))
    for step in range(length):
        buffer.add(nothing, nothing, inside[step].numpy(), starts[step].numpy(), values[step], values[step])
    buffer.compute_returns_and_advantage(next_values[-1], ended[-1].numpy())
    return buffer.advantages


def test_advantages_are_those_of_stable_baselines() -> None:
    """Its rollout buffer is the oracle, over episodes that end within the rollout and at its last step."""
    generator = torch.Generator().manual_seed(0)
    rewards, values, next_values = (torch.randn(30, 4, generator=generator) for _ in range(3))
    ended = torch.rand(30, 4, generator=generator) < 0.1
    ended[-1, 0] = True
    # within an episode the next value is the value of the next step
    next_values[:-1] = torch.where(ended[:-1], next_values[:-1], values[1:])
    advantages = ppo.advantages_of(rewards, values, next_values, ended)
    expected = sb3_advantages(rewards, values, next_values, ended)
    np.testing.assert_allclose(advantages, expected, rtol=0, atol=1e-5)  # float32 sums in another order


def test_learning_makes_what_was_good_more_likely() -> None:
    """That is the policy's gradient: the better throttles of a flight gain probability, the worse ones lose it."""
    torch.manual_seed(0)
    agent = ppo.Agent(38, 3)
    rollout = flown(agent)
    ppo.learn(agent, torch.optim.Adam(agent.parameters(), 1e-4), rollout)
    with torch.no_grad():
        gained = agent.distribution(rollout.observations).log_prob(rollout.throttles).sum(-1) - rollout.log_probs
    better = rollout.advantages > rollout.advantages.mean()
    assert gained[better].mean() > gained[~better].mean() + 1e-3


def test_ends_are_seen_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that fly on after an end: what they end with is worth something, unless the end was a termination."""
    monkeypatch.setattr(ppo, "LENGTH", 400)  # longer than an episode of 387 steps
    torch.manual_seed(0)
    agent = ppo.Agent(38, 3)
    found: list[tuple[Tensor, Tensor]] = []

    def watch(rewards: Tensor, values: Tensor, next_values: Tensor, ended: Tensor) -> Tensor:
        found.append((next_values, ended))
        return torch.zeros_like(rewards)

    monkeypatch.setattr(ppo, "advantages_of", watch)
    rollout = flown(agent)
    ((next_values, ended),) = found
    assert ended.any(dim=0).all()
    begun = torch.where(ended[:-1, 0])[0] + 1
    with torch.no_grad():
        first = agent.value(rollout.observations[begun, 0])
    assert (next_values[begun - 1, 0] != first).all()  # not the value of the next episode's first observation
    inside = ~ended[:-1]
    with torch.no_grad():
        following = agent.value(rollout.observations[1:])
    torch.testing.assert_close(next_values[:-1][inside], following[inside])


def test_ppo_trains() -> None:
    """A few updates, after each of which the policy costs something else."""
    torch.manual_seed(0)
    agent, costs = ppo.train("FormationKeeping-v0", 3 * ROWS * LENGTH, seed=1, reports=3)
    assert len(costs) == 4
    assert len(set(costs)) == 4
    assert agent.predict(np.zeros(38, np.float32))[0].shape == (3,)


def test_random_search_improves_on_seeds_it_has_not_seen() -> None:
    """In a second or two it learns to hold far better than coasting does."""
    result = CliRunner().invoke(random_search.app, ["FormationKeeping-v0", "--tries", "40", "--episodes", "2"])
    assert result.exit_code == 0, result.output
    words = result.output.splitlines()[-1].split()
    after, before = float(words[words.index("m/s,") - 1]), float(words[-1])
    assert after < 0.7 * before
