"""Trainings of a second."""

from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from agents.cli import app
from agents.policy.actor import Actor, Functions
from agents.training.checkpoint import load_checkpoint
from agents.training.run_folder import CHECKPOINT, Run, load_run
from agents.training.run_settings import plan_run
from formation_env import load_scenario
from formation_env.cli_errors import WRONG_INPUT
from formation_env.task.observation import SIZE

SCENARIO = """
spacecraft: {max_accel_m_s2: 0.002}
start: {formation: {kind: space_circle, x0_m: 2000, vx0_m_s: 0.2}, initial_sigma_pos_m: 50, initial_sigma_vel_m_s: 0.05}
phases:
  - {formation: {kind: space_circle, x0_m: 2000, vx0_m_s: 0.2}, hold_orbits: 0.1}
"""
SMALL = {
    "ppo": "rows: 8\nrollout_steps: 16\nbatch_size: 64\nepochs: 1\nnetwork: {hidden: [8]}\n",
    "sac": "rows: 8\ngradient_steps: 1\nbatch_size: 16\nbuffer_size: 500\nlearning_starts: 64\n"
    "network: {hidden: [8]}\n",
}
PRETRAINED = "pretraining: {teacher: lqr, rounds: 1, rows: 4, updates: 2, episodes: 4, batch: 2}\n"
"""Line for the hyperparameters of a run that imitates and follows the gradient, each a little."""


def small_run(folder: Path, algorithm: str, agent: str = "", **changes: Any) -> Run:
    """A run of a second on a scenario of 19 steps.

    Args:
        folder: gets the scenario and the hyperparameters, scenario.yaml and agent.yaml.
        algorithm: ppo or sac.
        agent: further lines of YAML after those of `SMALL`.
        changes: arguments of `plan_run`.
    """
    (folder / "scenario.yaml").write_text(SCENARIO)
    (folder / "agent.yaml").write_text(SMALL[algorithm] + agent)
    given = {"steps": 512, "validations": 2, "validation_episodes": 4, "config": folder / "agent.yaml", "threads": 1}
    return plan_run(algorithm, **({"env": str(folder / "scenario.yaml")} | given | changes))


def checkpoint_of(folder: Path) -> dict[str, Any]:
    """State in the checkpoint of a run's folder."""
    return load_checkpoint(folder / CHECKPOINT, load_run(folder))


def random_actor(squash: str, activation: str = "tanh", power: float = 2.0, width: int = 8) -> Actor:
    """An actor of the size of `small_run`'s networks, with thrusts on all axes."""
    rng = np.random.default_rng(5)
    shapes = ((width, SIZE), (3, width))
    layers = [tuple(rng.normal(0, 0.3, size).astype(np.float32) for size in (shape, shape[:1])) for shape in shapes]
    return Actor(layers, Functions(activation, squash, power, 50.0), load_scenario("keeping"))


def assert_refused(arguments: list[str], fault: str, last: bool = False) -> None:
    """The command says so in one line; with `last`, after others."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == WRONG_INPUT
    assert fault in result.stderr
    assert last or result.stderr.count("\n") == 1
