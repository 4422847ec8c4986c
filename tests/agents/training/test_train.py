"""Hyperparameters, training runs, saved models and the command line."""

import inspect
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from actor_helpers import assert_equal_up_to_rounding, rounding_bound
from agents_helpers import PRETRAINED, assert_refused, small_run
from stable_baselines3 import PPO, SAC
from typer.testing import CliRunner

from agents.algorithms.ppo import PPOSettings
from agents.algorithms.registry import load_settings
from agents.algorithms.sac import SACSettings
from agents.cli import app
from agents.cli import train as train_command
from agents.hyperparameters import VALIDATION_EPISODES, VALIDATIONS
from agents.results.evaluate import Sb3Policy
from agents.training.run_folder import (
    BEST,
    CHECKPOINT,
    CURVE,
    MODEL,
    PRETRAINED_BY,
    RUN,
    Run,
    load_best,
    load_run,
    save_model,
    start_run,
)
from agents.training.run_settings import plan_run
from agents.training.train import train, training_seeds
from agents.training.validation import validate
from formation_env import ConfigError, FormationVectorEnv
from formation_env.cli_errors import WRONG_INPUT
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.files import replacing
from formation_env.task.loading import ENV_IDS


@pytest.fixture(scope="module", params=["ppo", "sac"])
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Path]:
    """A short training of each algorithm."""
    folder = tmp_path_factory.mktemp(request.param)
    run = small_run(folder, request.param)
    assert train(run, folder / "run") == "finished"
    return run, folder / "run"


def test_a_run_leaves_models_settings_curve_and_tensorboard(finished: tuple[Run, Path]) -> None:
    """The contract of a run's folder; no temporary files stay."""
    run, folder = finished
    files = [BEST, CHECKPOINT, CURVE, MODEL, RUN, "tensorboard"]
    assert sorted(path.name for path in folder.iterdir()) == sorted(files)
    assert list((folder / "tensorboard").glob("events.out.tfevents.*"))
    assert load_run(folder) == run
    curve = pd.read_csv(folder / CURVE)
    assert list(curve["steps"]) == [0, 256, 512]
    assert (curve["return_low"] <= curve["return"]).all()
    assert (curve["return"] <= curve["return_high"]).all()


def test_the_curve_is_of_the_validation_seeds(finished: tuple[Run, Path]) -> None:
    """Flown again on these seeds, actor and SB3's model give the curve's best line, which has six digits."""
    run, folder = finished
    best = pd.read_csv(folder / CURVE)["return"].max()
    model = {"ppo": PPO, "sac": SAC}[run.algorithm].load(folder / MODEL, device="cpu")
    for policy in (load_best(folder)[1], Sb3Policy(model, 1.0)):
        table = evaluate(policy, run.scenario, seeds("validation", 4))
        assert table["return"].mean() == pytest.approx(best, rel=1e-5)


def test_a_plainly_loaded_model_acts_like_the_actor(finished: tuple[Run, Path]) -> None:
    """`PPO.load` and `SAC.load` know no throttle; what `predict` gives flies unchanged, with the same return."""
    run, folder = finished
    model = {"ppo": PPO, "sac": SAC}[run.algorithm].load(folder / MODEL, device="cpu")
    actor = load_best(folder)[1]
    observations = FormationVectorEnv(16, run.scenario).reset(seed=1)[0]
    for seen in (observations, observations[0]):
        actions = model.predict(seen, deterministic=True)[0]
        assert_equal_up_to_rounding(actions, actor.predict(seen)[0], rounding_bound(actor, seen))
    returns = [evaluate(policy, run.scenario, range(4))["return"] for policy in (model, actor)]
    np.testing.assert_allclose(*returns, rtol=1e-4)


def test_the_model_of_a_run_needs_no_throttle_power(finished: tuple[Run, Path]) -> None:
    """It has its own; given another, it would be applied twice."""
    run, folder = finished
    assert_refused(
        ["evaluate", str(folder / MODEL), run.env, "--allow-pickle", "--throttle-power", "2"],
        f"--throttle-power: leave it out; {folder / MODEL} applies its own, 2.0",
        last=True,
    )


def test_training_flies_training_seeds_only() -> None:
    """Nothing is learnt on seeds that judge; each run's seed has episodes of its own, as far as they reach."""
    split = seeds("training", 1_000_000)
    assert training_seeds(0, 128) == split[:128]
    assert training_seeds(3, 128) == split[384:512]
    with pytest.raises(ConfigError, match="seed: no training seeds are left for 128 rows, got 7812"):
        training_seeds(7812, 128)


def test_equal_seeds_train_equal_models(tmp_path: Path) -> None:
    """With one thread, the same run gives the same network, bit for bit; another seed gives another."""
    tables = []
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        train(small_run(tmp_path, "ppo", seed=seed), tmp_path / name)
        tables.append(pd.read_csv(tmp_path / name / CURVE).drop(columns="seconds"))
    pd.testing.assert_frame_equal(tables[0], tables[1], check_exact=True)
    assert not tables[0].equals(tables[2])


def test_interrupted_saving_leaves_the_old_model(tmp_path: Path) -> None:
    """Whatever breaks a save, the old file stays whole and no temporary is left."""

    class Breaks:
        def save(self, path: Path) -> None:
            path.write_bytes(b"half a mod")
            raise KeyboardInterrupt

    path = tmp_path / MODEL
    path.write_bytes(b"the old model")
    with pytest.raises(KeyboardInterrupt):
        save_model(Breaks(), path)
    assert path.read_bytes() == b"the old model"
    assert list(tmp_path.iterdir()) == [path]
    with replacing(path) as temporary:
        temporary.write_bytes(b"the new model")
    assert path.read_bytes() == b"the new model"
    assert list(tmp_path.iterdir()) == [path]


def test_shipped_hyperparameters_load_for_every_algorithm() -> None:
    """The shipped files are valid, and each gives its own class."""
    assert isinstance(load_settings("ppo", "keeping"), PPOSettings)
    assert isinstance(load_settings("sac", "mission"), SACSettings)


@pytest.mark.parametrize("env", [*ENV_IDS, "bad_communication"])
def test_both_algorithms_are_pretrained_in_the_same_way(env: str) -> None:
    """So one pretrained actor serves both, and what they make of it can be compared."""
    ppo, sac = load_settings("ppo", env), load_settings("sac", env)
    assert ppo.pretraining is not None
    for key in PRETRAINED_BY:
        assert getattr(ppo, key) == getattr(sac, key), key


def test_a_scenario_may_have_hyperparameters_of_its_own(tmp_path: Path) -> None:
    """An override counts for its scenario alone."""
    path = tmp_path / "ppo.yaml"
    path.write_text("gamma: 0.9\nenvironments: {FormationMission-v0: {gamma: 0.999}, bad_communication: {steps: 5}}")
    for name in ("mission", "FormationMission-v0"):
        assert load_settings("ppo", name, path) == PPOSettings(gamma=0.999)
    assert load_settings("ppo", "bad_communication", path) == PPOSettings(gamma=0.9, steps=5)
    assert load_settings("ppo", "keeping", path) == PPOSettings(gamma=0.9)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("gama: 0.9", "gama: unknown key; did you mean 'gamma'?"),
        ("gamma: '1e-3'", "gamma: must be a valid number, got the string '1e-3'"),
        ("gamma: 1.5", "gamma: must be less than or equal to 1, got 1.5"),
        ("rows: 0", "rows: must be greater than or equal to 1, got 0"),
        ("rows: 2.5", "rows: must be a valid integer, got 2.5"),
        ("network: {hidden: []}", "network.hidden:"),
        ("network: {activation: gelu}", "network.activation:"),
        ("batch_size: 1000", "batch_size: must divide rows * rollout_steps"),
        ("[1, 2]", "(top level): must be a mapping"),
        ("environments: {keping: {}}", "environments.keping: no such environment; did you mean 'keeping'?"),
        ("environments: {keeping: {gama: 1}}", "environments.keeping: gama: unknown key"),
        ("environments: {keeping: 3}", "environments.keeping: must be a mapping"),
        ("environments: 3", "environments: must be a mapping"),
    ],
)
def test_faulty_hyperparameters_are_one_line_with_file_and_key(tmp_path: Path, text: str, fault: str) -> None:
    """House rule: errors at the border, plain and located."""
    path = tmp_path / "ppo.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_settings("ppo", "keeping", path)
    assert str(error.value).startswith(f"{path}: {fault}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["pqo", "FormationKeeping-v0"], "no algorithm named 'pqo'; did you mean 'ppo'?"),
        (["ppo", "FormationKeping-v0"], "no environment named 'FormationKeping-v0'; did you mean"),
        (["ppo", "keping"], "no scenario named 'keping'; did you mean 'keeping'?"),
        (["ppo", "keeping", "--rows", "7"], "--rows: batch_size: must divide rows * rollout_steps"),
        (["ppo", "keeping", "--config", "missing.yaml"], "missing.yaml: cannot be read"),
        (["ppo", "keeping", "--seed", "999999"], "seed: no training seeds are left"),
    ],
)
def test_mistakes_on_the_command_line_are_one_line(tmp_path: Path, arguments: list[str], fault: str) -> None:
    """No traceback, and nothing is left on the disk."""
    result = CliRunner().invoke(app, ["train", *arguments, "--steps", "100", "--out", str(tmp_path / "run")])
    assert result.exit_code == WRONG_INPUT
    assert result.stderr.startswith("error: ")
    assert fault in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_folder_without_run_or_model_is_one_line(tmp_path: Path) -> None:
    """What is missing or damaged is named."""
    with pytest.raises(ConfigError, match=r"settings\.json: cannot be read: No such file"):
        load_best(tmp_path)
    start_run(small_run(tmp_path, "ppo"), tmp_path)
    for content in (None, "no actor"):
        if content is not None:
            (tmp_path / BEST).write_text(content)
        with pytest.raises(ConfigError, match=r"best\.safetensors: cannot be read"):
            load_best(tmp_path)
    data = json.loads((tmp_path / RUN).read_text())
    data["agent"]["gamma"] = 2
    (tmp_path / RUN).write_text(json.dumps(data))
    with pytest.raises(ConfigError, match=r"settings.json: agent: gamma: must be less than or equal to 1, got 2"):
        load_best(tmp_path)


def test_validation_is_of_the_mean_and_its_interval(tmp_path: Path) -> None:
    """A policy that coasts spends nothing and costs what its error costs: 0.01 m/s per m of mean error."""

    class Coast:
        def predict(self, observation: Any, **_: Any) -> tuple[Any, Any]:
            return np.zeros((len(observation), 3)), None

    line = validate(Coast(), small_run(tmp_path, "ppo").scenario, 8)
    assert line["delta_v_m_s"] == 0
    assert line["return"] == pytest.approx(-0.01 * line["position_error_mean_m"], rel=1e-12)
    assert line["return_low"] < line["return"] < line["return_high"]


def test_settings_survive_json(tmp_path: Path) -> None:
    """What a model is saved with is read back equal, scenario and hyperparameters alike."""
    run = plan_run("sac", "FormationMission-v0", steps=1000, rows=4)
    start_run(run, tmp_path)
    assert load_run(tmp_path) == run
    assert asdict(load_run(tmp_path).agent)["rows"] == 4


@pytest.mark.parametrize(
    ("agent", "changes", "fault"),
    [
        ("", {"validation_episodes": 2_000_000}, "validation_episodes: .*2000000"),
        ("", {"seed": 10**6}, "seed: no training seeds are left for 8 rows"),
        (PRETRAINED, {"seed": 70_000}, "seed: no training seeds are left for pretraining, got 70000"),
    ],
)
def test_what_would_fail_later_is_refused_at_once(
    agent: str, changes: dict[str, Any], fault: str, tmp_path: Path
) -> None:
    """Before a folder is made."""
    with pytest.raises(ConfigError, match=fault):
        train(small_run(tmp_path, "ppo", agent, **changes), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_defaults_of_the_command_line_are_those_of_a_run() -> None:
    """The command line states its defaults without importing what it runs."""
    given = inspect.signature(train_command).parameters
    assert given["validations"].default == VALIDATIONS
    assert given["validation_episodes"].default == VALIDATION_EPISODES
