"""An algorithm is one class: adding one takes a file with it and a line in the registry."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from agents_helpers import SCENARIO, SMALL, checkpoint_of

from agents.algorithms.registry import ALGORITHMS
from agents.hyperparameters import CommonSettings
from agents.training.run_folder import load_best, read_curve
from agents.training.run_settings import plan_run
from agents.training.train import resume, train
from formation_env import ConfigError
from formation_env.settings import Positive, settings

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv


@settings
class A2CSettings(CommonSettings):
    """Advantage actor-critic (Mnih et al. 2016), as someone might add it.

    Attributes:
        learning_rate: constant.
    """

    learning_rate: Positive = 1e-3

    def make_model(self, env: "VecEnv", seed: int) -> "BaseAlgorithm":
        """Build SB3's A2C."""
        from stable_baselines3 import A2C

        from agents.algorithms.throttle_policy import SquashedPolicy, policy_arguments

        return A2C(
            SquashedPolicy,
            env,
            self.learning_rate,
            n_steps=8,
            policy_kwargs=policy_arguments(self),
            seed=seed,
            device="cpu",
        )


def test_an_algorithm_of_ones_own_trains_stops_and_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the line in the registry it has hyperparameters from YAML, runs, checkpoints and a best policy."""
    monkeypatch.setitem(ALGORITHMS, "a2c", A2CSettings)
    (tmp_path / "scenario.yaml").write_text(SCENARIO)
    (tmp_path / "a2c.yaml").write_text("rows: 8\nnetwork: {hidden: [8]}\nlearning_rate: 2e-3\n")
    run = plan_run(
        "a2c",
        str(tmp_path / "scenario.yaml"),
        steps=256,
        validations=2,
        validation_episodes=4,
        config=tmp_path / "a2c.yaml",
    )
    assert train(run, tmp_path / "run", time_limit_s=0.0) == "out of time"
    assert resume(tmp_path / "run") == "finished"
    assert checkpoint_of(tmp_path / "run")["counters"]["num_timesteps"] == 256
    assert list(read_curve(tmp_path / "run")["steps"]) == [0, 128, 256]
    assert load_best(tmp_path / "run")[0] == run


def test_an_unknown_algorithm_is_one_line() -> None:
    """The nearest name is given, and hyperparameters of one algorithm are no other's."""
    with pytest.raises(ConfigError, match=r"no algorithm named 'ppp'; did you mean 'ppo'\?"):
        plan_run("ppp", "keeping")


def test_a_class_without_a_learner_says_so() -> None:
    """The base class cannot train."""
    with pytest.raises(NotImplementedError, match="CommonSettings: give it make_model"):
        CommonSettings().make_model(None, 0)  # type: ignore[arg-type]
    assert set(SMALL) == set(ALGORITHMS)
