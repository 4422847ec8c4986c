"""Frames saved to files: the last one of a flight, or one clear line."""

from pathlib import Path

import numpy as np
import pytest
from env_helpers import restless
from matplotlib import pyplot

from formation_env import FormationEnv, load_scenario
from formation_env.evaluation.snapshot import save_frame


@pytest.mark.parametrize(
    ("out", "steps", "message"),
    [
        ("a.txt", 1, r"\Aout: must end in \.png, got '.*a\.txt'\Z"),
        ("a", 1, r"out: must end in \.png"),
        ("a.png", 100_000, r"\Asteps: must be between 0 and the plan's 1015, got 100000\Z"),
        ("a.png", -1, r"steps: must be between 0 and"),
    ],
)
def test_save_frame_refuses_what_it_cannot_do(tmp_path: Path, out: str, steps: int, message: str) -> None:
    """One line, before anything is flown or written."""
    with pytest.raises(ValueError, match=message.replace("1015", str(load_scenario("keeping").num_steps))):
        save_frame(tmp_path / out, "keeping", steps)
    assert not list(tmp_path.iterdir())


def test_save_frame_says_that_a_limit_ended_the_flight(tmp_path: Path) -> None:
    """The frame is of the last step there was."""
    with pytest.warns(UserWarning, match=r"the flight ended at step \d+ of 25, beyond a limit"):
        save_frame(tmp_path / "a.png", restless(150.0), 25)
    assert (tmp_path / "a.png").exists()


def test_save_frame_writes_the_last_frame(tmp_path: Path) -> None:
    """PNG is lossless: the file holds the frame of a flight without thrust; no other file is left."""
    path = save_frame(tmp_path / "scene.png", "FormationKeeping-v0", steps=2, seed=1)
    env = FormationEnv("keeping", render_mode="rgb_array")
    env.reset(seed=1)
    env.render()
    for _ in range(2):
        env.step(np.zeros(3))
        frame = env.render()
    assert list(tmp_path.iterdir()) == [path]
    np.testing.assert_array_equal(np.rint(pyplot.imread(path)[..., :3] * 255), frame)
