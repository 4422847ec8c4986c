"""One frame of a flight, as a file."""

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
    """Fly, and write the last frame as a PNG file.

    Args:
        out: the file, written whole or not at all.
        env_id_or_scenario: a registered id, a scenario's name or path, or a Scenario.
        steps: how many to fly; the flight may end earlier.
        seed: of the episode.
        policy: what chooses the actions; without one the follower coasts.

    Returns:
        The file's path.

    Raises:
        ValueError: a negative number of steps.
    """
    if steps < 0:
        raise ValueError(f"steps: must be >= 0, got {steps}")
    env = FormationEnv(load_scenario(env_id_or_scenario), render_mode="rgb_array")
    observation, _ = env.reset(seed=seed)
    frame, state = env.render(), None
    for step in range(steps):
        action = np.zeros(3, np.float32)
        if policy is not None:
            starts = np.full(1, step == 0)
            action, state = policy.predict(observation, state=state, episode_start=starts, deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        frame = env.render()
        if terminated or truncated:
            break
    path = Path(out)
    with replacing(path) as temporary:
        imsave(temporary, frame, format="png", dpi=DPI)
    return path
