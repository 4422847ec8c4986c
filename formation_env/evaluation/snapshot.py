"""A frame of a flight, as a PNG file."""

import warnings
from pathlib import Path

import numpy as np
from matplotlib.image import imsave

from formation_env.envs.single import FormationEnv
from formation_env.evaluation.rollout import Policy
from formation_env.files import replacing
from formation_env.rendering.scene import DPI
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario


def save_frame(
    out: str | Path,
    env_id_or_scenario: str | Path | Scenario,
    steps: int,
    seed: int = 0,
    policy: Policy | None = None,
) -> Path:
    """Fly some steps, and save the last frame.

    Args:
        out: the file, NAME.png, written whole or not at all.
        env_id_or_scenario: a registered id, a scenario's name or path, or a Scenario.
        steps: number of steps to fly; a warning says so if a limit ends the flight earlier.
        seed: seed of the episode.
        policy: chooses the actions; without one the follower coasts.

    Returns:
        The file's path.

    Raises:
        ValueError: a file that does not end in .png, or a number of steps that the scenario's plan does not have.
    """
    path, scenario = Path(out), load_scenario(env_id_or_scenario)
    if path.suffix.lower() != ".png":
        raise ValueError(f"out: must end in .png, got {str(path)!r}")
    if not 0 <= steps <= scenario.num_steps:
        raise ValueError(f"steps: must be between 0 and the plan's {scenario.num_steps}, got {steps}")
    env = FormationEnv(scenario, render_mode="rgb_array")
    flown = _fly(env, steps, seed, policy)
    if flown < steps:
        warnings.warn(f"the flight ended at step {flown} of {steps}, beyond a limit of the scenario", stacklevel=2)
    frame = env.render()
    with replacing(path) as temporary:
        imsave(temporary, frame, format="png", dpi=DPI)
    return path


def _fly(env: FormationEnv, steps: int, seed: int, policy: Policy | None) -> int:
    """Fly an episode's first steps; returns how many there were before it ended."""
    observation, _ = env.reset(seed=seed)
    state = None
    for step in range(steps):
        action = np.zeros(3, np.float32)
        if policy is not None:
            starts = np.full(1, step == 0)
            action, state = policy.predict(observation, state=state, episode_start=starts, deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            return step + 1
    return steps
