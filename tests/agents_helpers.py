"""Trainings of a second."""

from pathlib import Path
from typing import Any

from agents.plan import plan_run
from agents.runs import Run

SCENARIO = """
spacecraft: {max_accel_m_s2: 0.002}
start: {formation: {kind: space_circle, x0_m: 2000, vx0_m_s: 0.2}, spread_pos_m: 50, spread_vel_m_s: 0.05}
phases:
  - {formation: {kind: space_circle, x0_m: 2000, vx0_m_s: 0.2}, hold_periods: 0.1}
"""
SMALL = {
    "ppo": "rows: 8\nrollout_steps: 16\nbatch_size: 64\nepochs: 1\nnetwork: {hidden: [8]}\n",
    "sac": "rows: 8\ngradient_steps: 1\nbatch_size: 16\nbuffer_size: 500\nlearning_starts: 64\n"
    "network: {hidden: [8]}\n",
}


def small_run(folder: Path, algorithm: str, agent: str = "", **changes: Any) -> Run:
    """A run of a second on a scenario of 19 steps.

    Args:
        folder: gets the scenario and the hyperparameters, scenario.yaml and agent.yaml.
        algorithm: ppo or sac.
        agent: lines of YAML beside those of `SMALL`.
        changes: arguments of `plan_run`.
    """
    (folder / "scenario.yaml").write_text(SCENARIO)
    (folder / "agent.yaml").write_text(SMALL[algorithm] + agent)
    given = {"steps": 512, "validations": 2, "validation_episodes": 4, "config": folder / "agent.yaml", "threads": 1}
    return plan_run(algorithm, **({"env": str(folder / "scenario.yaml")} | given | changes))
