"""Weights that have no regulator, and solvers that give up."""

from typing import Any

import numpy as np
import pytest

from baselines import make_policy
from baselines.design.riccati_solver import UNIT_FACTORS, in_some_units
from formation_env.settings import ConfigError

NO_POSITION = {"position": [0.0, 0.0, 0.0]}
NOTHING = {"position": [0.0, 0.0, 0.0], "velocity_s2": [0.0, 0.0, 0.0]}


@pytest.mark.parametrize("policy", ["lqr", "lqr_finite", "lqr_quasi_static"])
def test_weights_without_a_regulator_are_one_clear_error(policy: str) -> None:
    """Without a weight on position the along-track offset costs nothing and stays: scipy failed, or K was 7e-19."""
    settings: dict[str, Any] = {"design": "weights"} if policy == "lqr" else {}
    with pytest.raises(ConfigError, match=r"^weights: position \[0.0, 0.0, 0.0\] and .* set position weights > 0$"):
        make_policy(policy, "keeping", {**settings, "hold": NO_POSITION})
    with pytest.raises(ConfigError, match=r"^weights: position and velocity_s2 are all 0"):
        make_policy(policy, "keeping", {**settings, "hold": NOTHING})


def test_a_transfer_without_a_goal_is_an_error() -> None:
    """A last state of no weight: the gains were 0, the follower coasted."""
    with pytest.raises(ConfigError, match=r"^weights: position and velocity_s2 are all 0"):
        make_policy("lqr_finite", "initialization", {"transfer": NOTHING})


def test_some_position_weights_are_enough() -> None:
    """The radial offset drives the along-track one, so it need not cost anything itself."""
    policy = make_policy("lqr", "keeping", {"design": "weights", "hold": {"position": [0.0, 1.0, 1.0]}})
    assert np.abs(policy.K).max() > 1e-6


def test_other_units_are_tried() -> None:
    """The first units in which the solver does not give up; if it gives up in all, the error is the one given."""
    asked = []

    def solve(factor: float) -> float:
        asked.append(factor)
        if len(asked) < 3:
            raise np.linalg.LinAlgError("reordering failed")
        return factor

    assert in_some_units(solve, "no") == UNIT_FACTORS[2]

    def give_up(_: float) -> float:
        raise ValueError("reordering failed")

    with pytest.raises(ConfigError, match=r"^no solution$"):
        in_some_units(give_up, "no solution")
