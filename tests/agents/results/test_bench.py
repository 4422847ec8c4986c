"""The measurement of PPO's speed."""

from agents.algorithms.ppo import PPOSettings
from agents.results.bench import measure


def test_shares_and_rates_fit_each_other() -> None:
    """The environment takes part of the time; one thread computes no longer than the clock runs (but for its ticks)."""
    agent = PPOSettings(rows=64, rollout_steps=8, batch_size=64, epochs=1)
    speeds = measure(agent, "FormationKeeping-v0", threads=1, rounds=2)
    assert len(speeds) == 2
    for speed in speeds:
        assert 0 < speed.env_share < 1
        elapsed_s, cpu_s = 512 / speed.steps_per_s, 512 / speed.steps_per_cpu_s
        assert 0 < cpu_s < elapsed_s + 0.01
