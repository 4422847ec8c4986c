"""A training that begins with an actor, given or pretrained, and explores little from there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from agents_helpers import PRETRAINED, assert_refused, checkpoint_of, random_actor, small_run

from agents.algorithms.models import make_env, make_model
from agents.algorithms.to_actor import actor_of
from agents.policy.actor import Actor, Functions, read_actor, to_bytes
from agents.training.run_folder import (
    BEST,
    CURVE,
    PRETRAINING,
    START,
    Run,
    load_run,
    read_pretraining,
    start_run,
)
from agents.training.train import resume, train
from agents.training.validation import validate
from agents.training.warm_start import start_from
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE


@pytest.mark.parametrize(
    ("algorithm", "activation", "agent"),
    [
        ("ppo", "tanh", ""),
        ("ppo", "tanh", "use_sde: true"),
        ("sac", "relu", ""),
        ("sac", "relu", "use_sde: true"),
    ],
)
def test_a_start_flies_as_the_file_says(algorithm: str, activation: str, agent: str, tmp_path: Path) -> None:
    """The first deterministic actions are those of the file; noise and critics are the seed's, as without it."""
    run = small_run(tmp_path, algorithm, agent)
    run = replace(run, agent=replace(run.agent, network=replace(run.agent.network, activation=activation)))
    path = tmp_path / "actor.safetensors"
    path.write_bytes(to_bytes(given := random_actor("tanh", activation)))
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
        (random_actor("tanh", width=9), "hidden: must be [8], by algorithm and hyperparameters, got [9]"),
        (
            random_actor("tanh", activation="relu"),
            "activation: must be tanh",
        ),
        (random_actor("clip"), "squash: must be tanh"),
        (random_actor("tanh", power=3.0), "throttle_power: must be 2.0"),
        (None, "no such file or folder"),
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
    path.write_bytes(to_bytes(random_actor("tanh")))
    run = small_run(tmp_path, "ppo", start=path)
    train(run, tmp_path / "run")
    assert (tmp_path / "run" / START).read_bytes() == path.read_bytes()
    assert load_run(tmp_path / "run").start == str(path)
    last = checkpoint_of(tmp_path / "run")["parameters"]["policy"]
    assert not np.array_equal(last["action_net.weight"].numpy(), random_actor("tanh").layers[-1][0])


def learnt(run: Run, folder: Path) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
    """A run's network before and after."""
    before = make_model(run.agent, make_env(run.agent, run.scenario), run.seed).policy.state_dict()
    train(run, folder)
    return before, checkpoint_of(folder)["parameters"]["policy"]


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


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_a_run_is_pretrained_once(algorithm: str, tmp_path: Path) -> None:
    """The curve begins with the best of the judged; killed before there was an actor, the run makes the same again."""
    run = small_run(tmp_path, algorithm, PRETRAINED)
    train(run, tmp_path / "whole")
    actor = read_actor(tmp_path / "whole" / START, run.scenario)
    assert actor.functions == Functions("tanh", "tanh", 2.0, 50.0)
    first = pd.read_csv(tmp_path / "whole" / CURVE)["return"][0]
    assert first == pytest.approx(validate(actor, run.scenario, run.validation_episodes)["return"], rel=1e-4)
    judged = read_pretraining(tmp_path / "whole")
    assert judged is not None
    assert list(judged["done"]) == ["after imitating lqr", "after 2 updates through the model"]
    assert judged["return"].max() == pytest.approx(first, rel=1e-5)  # six digits in both files
    assert (judged["seconds"].diff()[1:] >= 0).all()
    kept = (tmp_path / "whole" / PRETRAINING).read_bytes()
    assert resume(tmp_path / "whole") == "finished"
    assert (tmp_path / "whole" / PRETRAINING).read_bytes() == kept  # and so is the time that it took
    start_run(run, tmp_path / "killed")
    assert resume(tmp_path / "killed") == "finished"
    assert (tmp_path / "killed" / START).read_bytes() == (tmp_path / "whole" / START).read_bytes()
    assert (tmp_path / "killed" / BEST).read_bytes() == (tmp_path / "whole" / BEST).read_bytes()


def test_two_algorithms_share_a_pretrained_actor(tmp_path: Path) -> None:
    """SAC starts from the folder of PPO's run, keeps how the actor came about, and refuses another seed's."""
    first = small_run(tmp_path, "ppo", PRETRAINED)
    train(first, tmp_path / "ppo")
    second = small_run(tmp_path, "sac", PRETRAINED, start=tmp_path / "ppo")
    second = replace(second, agent=replace(second.agent, network=first.agent.network))
    train(second, tmp_path / "sac")
    for name in (START, PRETRAINING):
        assert (tmp_path / "sac" / name).read_bytes() == (tmp_path / "ppo" / name).read_bytes()
    with pytest.raises(ConfigError, match="seed: must be this run's, 1, got 0"):
        train(replace(second, seed=1), tmp_path / "other")
    assert not (tmp_path / "other").exists()
