"""The measurement of PPO's speed."""

import subprocess

import pytest
from typer.testing import CliRunner

import formation_env.__main__ as command_line
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


def test_the_environments_bench_asks_the_agents(monkeypatch: pytest.MonkeyPatch) -> None:
    """It imports nothing of them: another process prints, and its status is handed on."""
    monkeypatch.setattr(subprocess, "call", lambda command: 7 if command[1:] == ["-m", "agents", "bench"] else 0)
    assert CliRunner().invoke(command_line.app, ["bench", "--sb3"]).exit_code == 7
