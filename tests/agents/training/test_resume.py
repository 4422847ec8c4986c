"""Trainings that stop and go on, that start from an actor, and what they may learn from."""

import re
import signal
from pathlib import Path

import pandas as pd
import pytest
import torch
from agents_helpers import assert_refused, checkpoint_of, random_actor, small_run
from safetensors.torch import load_file
from typer.testing import CliRunner

from agents.cli import app
from agents.policy.actor import to_bytes
from agents.training.run_folder import BEST, CHECKPOINT, CURVE, RUN, start_run
from agents.training.run_settings import default_folder
from agents.training.train import resume, train
from agents.training.validation import Validation
from formation_env import ConfigError
from formation_env.cli_errors import INTERRUPTED, WRONG_INPUT


class KilledError(Exception):
    """What a kill is to the training: it can do nothing about it."""


def results(folder: Path) -> tuple[dict[str, torch.Tensor], pd.DataFrame]:
    """What a run came to: its last network and its best actor, and its curve without the clock."""
    last = checkpoint_of(folder)["parameters"]["policy"]
    return last | load_file(folder / BEST), pd.read_csv(folder / CURVE).drop(columns="seconds")


def assert_same_results(one: Path, other: Path) -> None:
    """Equal to the last bit."""
    (weights, curve), (other_weights, other_curve) = results(one), results(other)
    for name, tensor in weights.items():
        assert torch.equal(tensor, other_weights[name]), name
    pd.testing.assert_frame_equal(curve, other_curve, check_exact=True)


def kill_at(step: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have trainings die in the middle of the rollout that comes to this step."""
    on_step = Validation._on_step

    def dies(self: Validation) -> bool:
        if self.num_timesteps >= step:
            raise KilledError
        return on_step(self)

    monkeypatch.setattr(Validation, "_on_step", dies)


ALL_OPTIONS = "use_sde: true\nsde_sample_freq: 5\nnormalise_reward: true\nshaping_weight: 0.01\n"


@pytest.mark.parametrize(
    ("algorithm", "agent"),
    [
        ("ppo", ""),
        ("ppo", ALL_OPTIONS + "bootstrap_end: true\nwarmup_rollouts: 3\n"),
        ("sac", ""),
        ("sac", ALL_OPTIONS + "actor_delay_steps: 200\nactor_every: 3\n"),
        ("sac", "after_state: true\nn_steps: 4\nexploration_impulses: {probability: 0.2}\nlearning_rate_end: 1e-4\n"),
    ],
)
def test_killed_and_resumed_is_uninterrupted(
    algorithm: str, agent: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed twice, once after a checkpoint and once before the next, a run comes to the same bits as undisturbed."""
    run = small_run(tmp_path, algorithm, agent, validations=3)
    train(run, tmp_path / "whole")
    with monkeypatch.context() as patch:
        kill_at(300, patch)
        with pytest.raises(KilledError):
            train(run, tmp_path / "killed")
        with pytest.raises(KilledError):
            resume(tmp_path / "killed")
    assert checkpoint_of(tmp_path / "killed")["counters"]["num_timesteps"] < 300
    assert resume(tmp_path / "killed") == "finished"
    assert_same_results(tmp_path / "whole", tmp_path / "killed")
    assert resume(tmp_path / "killed") == "finished"  # there is nothing left to do
    assert_same_results(tmp_path / "whole", tmp_path / "killed")


def test_a_run_killed_before_its_first_checkpoint_begins_anew(tmp_path: Path) -> None:
    """Its settings are there, and so is the actor to start from: that is all it takes."""
    actor = tmp_path / "actor.safetensors"
    actor.write_bytes(to_bytes(random_actor("tanh")))
    run = small_run(tmp_path, "ppo", start=actor)
    train(run, tmp_path / "whole")
    start_run(run, tmp_path / "killed")
    actor.unlink()
    assert resume(tmp_path / "killed") == "finished"
    assert_same_results(tmp_path / "whole", tmp_path / "killed")


def test_ctrl_c_saves_and_ends_and_resume_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked to stop in mid-rollout, the command saves, says how to go on, and exits like an interrupted one."""
    small_run(tmp_path, "ppo")
    options = ["--steps", "512", "--validations", "2", "--validation-episodes", "4", "--threads", "1"]
    options += ["--config", str(tmp_path / "agent.yaml")]
    command = ["train", "ppo", str(tmp_path / "scenario.yaml"), *options]
    assert CliRunner().invoke(app, [*command, "--out", str(tmp_path / "whole")]).exit_code == 0
    on_step = Validation._on_step

    def interrupts(self: Validation) -> bool:
        if self.num_timesteps == 296:
            signal.raise_signal(signal.SIGINT)
        return on_step(self)

    with monkeypatch.context() as patch:
        patch.setattr(Validation, "_on_step", interrupts)
        result = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "run")])
    assert result.exit_code == INTERRUPTED
    assert f"interrupted; continue with: formation-env agents train --out {tmp_path / 'run'} --resume" in result.stderr
    assert checkpoint_of(tmp_path / "run")["counters"]["num_timesteps"] == 384
    again = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "run")])
    assert again.exit_code == WRONG_INPUT
    assert f"error: {tmp_path / 'run'}: holds a run already" in again.stderr
    result = CliRunner().invoke(
        app, ["train", "ppo", str(tmp_path / "scenario.yaml"), "--resume", "--out", str(tmp_path / "run")]
    )
    assert result.exit_code == 0, result.output
    assert_same_results(tmp_path / "whole", tmp_path / "run")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_time_limit_saves_and_stops(tmp_path: Path) -> None:
    """Out of time at the first rollout; what is left is flown when there is time."""
    run = small_run(tmp_path, "ppo")
    assert train(run, tmp_path / "run", time_limit_s=0.0) == "out of time"
    assert checkpoint_of(tmp_path / "run")["counters"]["num_timesteps"] == 0
    assert resume(tmp_path / "run") == "finished"
    assert list(pd.read_csv(tmp_path / "run" / CURVE)["steps"]) == [0, 256, 512]


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--steps", "100"], "ppo .*scenario.yaml; leave out steps"),
        (["sac"], "continues as it began: ppo .*; leave out algorithm"),
        (["ppo", "keeping"], "leave out env"),
        (["--seed", "0"], "leave out seed"),
    ],
)
def test_resume_takes_nothing_that_would_make_it_another_run(tmp_path: Path, arguments: list[str], fault: str) -> None:
    """One line, which names the option."""
    start_run(small_run(tmp_path, "ppo"), tmp_path / "run")
    result = CliRunner().invoke(app, ["train", *arguments, "--resume", "--out", str(tmp_path / "run")])
    assert result.exit_code == WRONG_INPUT
    assert result.stderr.count("\n") == 1
    assert re.search(fault, result.stderr)


def test_what_cannot_be_resumed_is_one_line(tmp_path: Path) -> None:
    """No run, a damaged checkpoint, or nothing said at all."""
    assert_refused(["train"], "train: give an algorithm and an environment, or --out FOLDER --resume")
    assert_refused(
        ["train", "--resume", "--out", str(tmp_path / "none")], "settings.json: cannot be read: No such file"
    )
    start_run(small_run(tmp_path, "ppo"), tmp_path / "run")
    for content in (b"", b"no checkpoint"):
        (tmp_path / "run" / CHECKPOINT).write_bytes(content)
        assert_refused(
            ["train", "--resume", "--out", str(tmp_path / "run")], f"{CHECKPOINT}: damaged, or not a checkpoint"
        )


def test_runs_have_a_folder_and_steps_of_their_own(tmp_path: Path) -> None:
    """What the command leaves out comes from the hyperparameters' file and from what is trained."""
    run = small_run(tmp_path, "sac", "steps: 777", steps=None, seed=3)
    assert run.steps == 777
    assert default_folder(run) == Path("runs/sac_scenario_seed3")
    assert run.versions["git"] == "" or len(run.versions["git"].removesuffix("-dirty")) == 40
    start_run(run, tmp_path / "run")
    assert (tmp_path / "run" / RUN).exists()
    with pytest.raises(ConfigError, match=r"holds a run already; continue it with --out"):
        start_run(run, tmp_path / "run")
