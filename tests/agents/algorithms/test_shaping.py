"""Shaping changes what is learnt from, and nothing that is reported."""

from pathlib import Path

import numpy as np
import pytest
from agents_helpers import small_run

from agents.algorithms.shaping import Shaping
from agents.algorithms.vec_env import Sb3VecEnv
from formation_env.task.observation import observation_layout


@pytest.mark.parametrize("bootstrap_end", [False, True])
def test_shaping_adds_nothing_but_the_potential_of_the_start(bootstrap_end: bool, tmp_path: Path) -> None:
    """Ng, Harada & Russell (1999): discounted, what is added sums to -Phi(start), whatever is flown.

    With the value of the last observation behind the end, gamma^T Phi(last) is left over: it is taken off that value.
    The oracle is the unshaped environment, and the potential taken from the layout's `zero_effort_miss`.
    """
    gamma, weight, rows = 0.9, 0.02, 4
    scenario = small_run(tmp_path, "ppo").scenario
    shaped = Sb3VecEnv(rows, scenario, shaping=Shaping(scenario, weight, gamma), bootstrap_end=bootstrap_end)
    plain = Sb3VecEnv(rows, scenario, bootstrap_end=bootstrap_end)
    noise = np.random.default_rng(3)
    for env in (plain, shaped):
        env.seed(6)
    starts, added, returns = shaped.reset(), np.zeros(rows), []
    plain.reset()
    for step in range(scenario.num_steps):
        action = noise.uniform(-0.3, 0.3, (rows, 3)).astype(np.float32)
        one, other = plain.step(action), shaped.step(action)
        added += gamma**step * (other[1].astype(float) - one[1])
        returns = [(a["episode"]["r"], b["episode"]["r"]) for a, b in zip(one[3], other[3], strict=True) if a]
    assert len(returns) == rows
    assert all(a == b for a, b in returns), "the reported return is never shaped"
    lasts = np.stack([info["terminal_observation"] for info in other[3]])
    layout = observation_layout(scenario)
    phi, last = (
        -weight * np.linalg.norm(layout.state(seen, "zero_effort_miss")[:, :3], axis=1) for seen in (starts, lasts)
    )
    assert (phi < -0.1).all()
    left = gamma**scenario.num_steps * last if bootstrap_end else 0.0
    np.testing.assert_allclose(added, left - phi, rtol=1e-4)  # rewards are float32
