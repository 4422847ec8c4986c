"""Trainings that stop and go on, that start from an actor, and what they may learn from."""

import re
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from agents_helpers import small_run
from safetensors.torch import load_file
from typer.testing import CliRunner

from agents.__main__ import INTERRUPTED, MISTAKE, app
from agents.actor import Actor, Functions, to_bytes
from agents.checkpoint import load_checkpoint
from agents.convert import actor_of
from agents.models import make_env, make_model
from agents.plan import default_folder
from agents.runs import BEST, CHECKPOINT, CURVE, RUN, START, Run, load_run, start_run
from agents.shaping import Shaping
from agents.start import start_from
from agents.train import resume, train
from agents.validation import Validation
from agents.vec_env import Sb3VecEnv
from formation_env import ConfigError, load_scenario
from formation_env.observation import SIZE
from formation_env.schedule import observation_layout


class KilledError(Exception):
    """What a kill is to the training: it can do nothing about it."""


def results(folder: Path) -> tuple[dict[str, torch.Tensor], pd.DataFrame]:
    """What a run came to: its last network and its best actor, and its curve without the clock."""
    last = load_checkpoint(folder / CHECKPOINT)["parameters"]["policy"]
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
        ("sac", ALL_OPTIONS + "actor_delay_steps: 200\n"),
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
    assert load_checkpoint(tmp_path / "killed" / CHECKPOINT)["counters"]["num_timesteps"] < 300
    assert resume(tmp_path / "killed") == "finished"
    assert_same_results(tmp_path / "whole", tmp_path / "killed")
    assert resume(tmp_path / "killed") == "finished"  # there is nothing left to do
    assert_same_results(tmp_path / "whole", tmp_path / "killed")


def test_a_run_killed_before_its_first_checkpoint_begins_anew(tmp_path: Path) -> None:
    """Its settings are there, and so is the actor to start from: that is all it takes."""
    actor = tmp_path / "actor.safetensors"
    actor.write_bytes(to_bytes(random_actor("clip")))
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
    assert f"interrupted; go on with: python -m agents train --resume {tmp_path / 'run'}" in result.stderr
    assert load_checkpoint(tmp_path / "run" / CHECKPOINT)["counters"]["num_timesteps"] == 384
    again = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "run")])
    assert again.exit_code == MISTAKE
    assert f"error: {tmp_path / 'run'}: holds a run already" in again.stderr
    result = CliRunner().invoke(
        app, ["train", "ppo", str(tmp_path / "scenario.yaml"), "--resume", str(tmp_path / "run")]
    )
    assert result.exit_code == 0, result.output
    assert_same_results(tmp_path / "whole", tmp_path / "run")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_time_limit_saves_and_stops(tmp_path: Path) -> None:
    """Out of time at the first rollout; what is left is flown when there is time."""
    run = small_run(tmp_path, "ppo")
    assert train(run, tmp_path / "run", time_limit_s=0.0) == "out of time"
    assert load_checkpoint(tmp_path / "run" / CHECKPOINT)["counters"]["num_timesteps"] == 0
    assert resume(tmp_path / "run") == "finished"
    assert list(pd.read_csv(tmp_path / "run" / CURVE)["steps"]) == [0, 256, 512]


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--steps", "100"], "ppo .*scenario.yaml; leave out steps"),
        (["sac"], "goes on as it began: ppo .*; leave out algorithm"),
        (["ppo", "keeping"], "leave out env"),
        (["--seed", "0"], "leave out seed"),
    ],
)
def test_resume_takes_nothing_that_would_make_it_another_run(tmp_path: Path, arguments: list[str], fault: str) -> None:
    """One line, which names the option."""
    start_run(small_run(tmp_path, "ppo"), tmp_path / "run")
    result = CliRunner().invoke(app, ["train", *arguments, "--resume", str(tmp_path / "run")])
    assert result.exit_code == MISTAKE
    assert result.stderr.count("\n") == 1
    assert re.search(fault, result.stderr)


def test_what_cannot_be_resumed_is_one_line(tmp_path: Path) -> None:
    """No run, a damaged checkpoint, or nothing said at all."""
    assert_refused(["train"], "train: give an algorithm and an environment, or --resume FOLDER")
    assert_refused(["train", "--resume", str(tmp_path / "none")], "settings.json: cannot be read: No such file")
    start_run(small_run(tmp_path, "ppo"), tmp_path / "run")
    for content in (b"", b"no checkpoint"):
        (tmp_path / "run" / CHECKPOINT).write_bytes(content)
        assert_refused(["train", "--resume", str(tmp_path / "run")], f"{CHECKPOINT}: damaged, or no checkpoint")


def assert_refused(arguments: list[str], fault: str) -> None:
    """The command says so in one line."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == MISTAKE
    assert fault in result.stderr
    assert result.stderr.count("\n") == 1


def random_actor(squash: str, activation: str = "tanh", power: float = 2.0, width: int = 8) -> Actor:
    """An actor of the size of `small_run`'s networks, with thrusts on all axes."""
    rng = np.random.default_rng(5)
    shapes = ((width, SIZE), (3, width))
    layers = [tuple(rng.normal(0, 0.3, size).astype(np.float32) for size in (shape, shape[:1])) for shape in shapes]
    return Actor(layers, Functions(activation, squash, power, 50.0), load_scenario("keeping"))


@pytest.mark.parametrize(
    ("algorithm", "squash", "activation", "agent"),
    [
        ("ppo", "clip", "tanh", ""),
        ("ppo", "clip", "tanh", "use_sde: true"),
        ("sac", "tanh", "relu", ""),
        ("sac", "tanh", "relu", "use_sde: true"),
    ],
)
def test_a_start_flies_as_the_file_says(
    algorithm: str, squash: str, activation: str, agent: str, tmp_path: Path
) -> None:
    """The first deterministic actions are those of the file; noise and critics are the seed's, as without it."""
    run = small_run(tmp_path, algorithm, agent)
    run = replace(run, agent=replace(run.agent, network=replace(run.agent.network, activation=activation)))
    path = tmp_path / "actor.safetensors"
    path.write_bytes(to_bytes(given := random_actor(squash, activation)))
    env = make_env(run.agent, run.scenario)
    fresh, started = make_model(run.agent, env, 0), make_model(run.agent, env, 0)
    start_from(path, started, run.agent, run.scenario)
    observations = np.random.default_rng(0).normal(0, 1, (50, SIZE)).astype(np.float32)
    expected = given.predict(observations)[0]
    z = started.predict(observations, deterministic=True)[0]
    np.testing.assert_allclose(np.sign(z) * np.abs(z) ** 2, expected, rtol=0, atol=3e-6)  # float32 sums
    np.testing.assert_array_equal(actor_of(started, 2.0, run.scenario).predict(observations)[0], expected)
    actor_parts = ("policy_net", "action_net", "actor.latent_pi", "actor.mu")
    for name, tensor in started.policy.state_dict().items():
        assert torch.equal(tensor, fresh.policy.state_dict()[name]) != any(part in name for part in actor_parts), name


@pytest.mark.parametrize(
    ("actor", "fault"),
    [
        (random_actor("clip", width=9), "hidden: must be [8], by algorithm and hyperparameters, got [9]"),
        (
            random_actor("clip", activation="relu"),
            "activation: must be tanh",
        ),
        (random_actor("tanh"), "squash: must be clip"),
        (random_actor("clip", power=3.0), "throttle_power: must be 2.0"),
        (None, "cannot be read"),
    ],
)
def test_a_start_that_does_not_fit_is_one_line(tmp_path: Path, actor: Actor | None, fault: str) -> None:
    """It names the file and what is wrong, and no folder is left."""
    run, path = small_run(tmp_path, "ppo"), tmp_path / "actor.safetensors"
    if actor is not None:
        path.write_bytes(to_bytes(actor))
    command = ["train", "ppo", run.env, "--config", str(tmp_path / "agent.yaml"), "--start", str(path)]
    assert_refused([*command, "--steps", "100", "--out", str(tmp_path / "run")], fault)
    assert not (tmp_path / "run").exists()


def test_a_run_from_a_start_is_noted_with_it(tmp_path: Path) -> None:
    """The curve begins with the file's actor, of which the run keeps a copy; and learning changes it."""
    path = tmp_path / "actor.safetensors"
    path.write_bytes(to_bytes(random_actor("clip")))
    run = small_run(tmp_path, "ppo", start=path)
    train(run, tmp_path / "run")
    assert (tmp_path / "run" / START).read_bytes() == path.read_bytes()
    assert load_run(tmp_path / "run").start == str(path)
    last = load_checkpoint(tmp_path / "run" / CHECKPOINT)["parameters"]["policy"]
    assert not np.array_equal(last["action_net.weight"].numpy(), random_actor("clip").layers[-1][0])


def learnt(run: Run, folder: Path) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
    """A run's network before and after."""
    before = make_model(run.agent, make_env(run.agent, run.scenario), run.seed).policy.state_dict()
    train(run, folder)
    return before, load_checkpoint(folder / CHECKPOINT)["parameters"]["policy"]


@pytest.mark.parametrize(
    ("algorithm", "agent", "actor"),
    [
        ("ppo", "warmup_rollouts: 4", ("policy_net", "action_net", "log_std")),
        ("sac", "actor_delay_steps: 512", ("actor.",)),
    ],
)
def test_while_the_critic_warms_up_the_actor_stays(
    algorithm: str, agent: str, actor: tuple[str, ...], tmp_path: Path
) -> None:
    """512 steps are 4 rollouts of 8 rows and 16 steps: in the 512 steps that follow the actor learns, too."""
    for steps, moves in ((512, False), (1024, True)):
        before, after = learnt(small_run(tmp_path, algorithm, agent, steps=steps), tmp_path / str(steps))
        for name, tensor in after.items():
            part = any(part in name for part in actor)
            assert torch.equal(tensor, before[name]) == (part and not moves), name


def test_exploration_does_not_fall_below_its_limit(tmp_path: Path) -> None:
    """Begun below the limit, the noise is at it or above after the first update."""
    run = small_run(tmp_path, "ppo", "log_std_init: -4.0\nlog_std_min: -2.0", steps=128)
    before, after = learnt(run, tmp_path / "run")
    assert (before["log_std"] == -4).all()
    assert (after["log_std"] == -2).all()


@pytest.mark.parametrize("bootstrap_end", [False, True])
def test_shaping_adds_nothing_but_the_potential_of_the_start(bootstrap_end: bool, tmp_path: Path) -> None:
    """Ng, Harada & Russell (1999): discounted, what is added sums to -Phi(start), whatever is flown.

    With the value of the last observation behind the end, gamma^T Phi(last) is left over: it is taken off that value.
    The oracle is the unshaped environment, and the potential taken from the layout's `arrival_error`.
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
        -weight * np.linalg.norm(layout.state(seen, "arrival_error")[:, :3], axis=1) for seen in (starts, lasts)
    )
    assert (phi < -0.1).all()
    left = gamma**scenario.num_steps * last if bootstrap_end else 0.0
    np.testing.assert_allclose(added, left - phi, rtol=1e-4)  # rewards are float32


def test_runs_have_a_folder_and_steps_of_their_own(tmp_path: Path) -> None:
    """What the command leaves out comes from the hyperparameters' file and from what is trained."""
    run = small_run(tmp_path, "sac", "steps: 777", steps=None, seed=3)
    assert run.steps == 777
    assert default_folder(run) == Path("runs/sac_scenario_seed3")
    assert run.versions["git"] == "" or len(run.versions["git"].removesuffix("-dirty")) == 40
    start_run(run, tmp_path / "run")
    assert (tmp_path / "run" / RUN).exists()
    with pytest.raises(ConfigError, match=r"holds a run already; go on with --resume"):
        start_run(run, tmp_path / "run")
