"""Learned policies beside classical ones: the report, and the evaluation of a policy of one's own."""

import json
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from typer.testing import CliRunner, Result

from agents import Actor
from agents.algorithms.vec_env import Sb3VecEnv
from agents.cli import app
from agents.policy import library
from agents.policy.actor import Functions, to_bytes
from agents.policy.library import CARD, TENSORS, policy_name, sha256
from agents.results import report
from agents.results.evaluate import Sb3Policy, algorithm_of
from agents.results.report import Learned, envs_of, parse_models
from baselines.controllers.registry import POLICIES
from baselines.experiments.policy_factories import describe
from baselines.experiments.sweep import points
from baselines.report import ReportOptions
from formation_env import ENV_IDS, ConfigError, Scenario, load_scenario
from formation_env.cli_errors import WRONG_INPUT
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import summarise
from formation_env.task.observation import SIZE

KEEPING, START = "FormationKeeping-v0", "FormationInitialization-v0"
EPISODES = 2


def trained(seed: int, cost: dict[str, float]) -> dict[str, object]:
    """A run of two minutes with one before it."""
    times = {"pretraining_s": 60.0, "wall_time_s": 120.0}
    return {"seed": seed, "steps": 1000, "validation_cost_m_s": 0.0, "test_cost_m_s": cost, "saved_m_s": None} | times


def write_policy(folder: Path, algorithm: str, env: str) -> Path:
    """A shipped policy that has never learnt: it pushes a little, in a direction that depends on the algorithm."""
    scenario = load_scenario(ENV_IDS.get(env, env))
    bias = np.full(3, 0.02 if algorithm == "ppo" else -0.02, np.float32)
    actor = Actor([(np.zeros((3, SIZE), np.float32), bias)], Functions("tanh", "clip", 1.0), scenario)
    interval = {"mean": 0.0, "low": 0.0, "high": 0.0}
    card = {
        "algorithm": algorithm,
        "env": env,
        "observation_size": SIZE,
        "sha256": sha256(to_bytes(actor)),
        "test": {"return": interval},
        "test_episodes": 2,
        "first_test_costs_m_s": [],
        "cost_over_runs_m_s": None,
        "runs": [trained(seed, interval) for seed in (0, 1)],
        "training": {},
        "scenario": json.loads(json.dumps(vars(scenario), default=vars)),
    }
    path = folder / f"{policy_name(algorithm, env)}{TENSORS}"
    path.write_bytes(to_bytes(actor))
    path.with_suffix(CARD).write_text(json.dumps(card))
    return path


@pytest.fixture
def policies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped policies: both algorithms on Initialization, one on Keeping."""
    folder = tmp_path / "policies"
    folder.mkdir()
    for algorithm, env in (("ppo", START), ("sac", START), ("ppo", KEEPING)):
        write_policy(folder, algorithm, env)
    monkeypatch.setattr(library, "SHIPPED", folder)
    return folder


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


WITHOUT_LEARNING_LIBRARIES = """
import pathlib, sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in ("torch", "stable_baselines3", "tensorboard", "onnx"):
            raise ModuleNotFoundError(name=name)

sys.meta_path.insert(0, Missing())
from agents.policy import library as shipped
from agents.cli import app

shipped.SHIPPED = pathlib.Path(sys.argv.pop(1))
app()
"""


def test_shipped_policies_stand_in_the_report_by_themselves(policies: Path, tmp_path: Path) -> None:
    """Without --model each algorithm flies its policy beside all classical ones, on equal seeds, and without torch."""
    out = tmp_path / "reports"
    few = ["--episodes", EPISODES, "--slow-episodes", 1, "--sweep-episodes", 0, "--processes", 1]
    command = [sys.executable, "-c", WITHOUT_LEARNING_LIBRARIES, policies, "report", START, *few, "--out", out]
    found = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, timeout=300)
    assert found.returncode == 0, found.stderr
    table = pd.read_csv(out / "episodes.csv")
    assert set(table["policy"]) == {*POLICIES, "ppo", "sac"}
    again = evaluate(library.load_policy("sac", START), START, seeds("test", EPISODES))
    own = table[table["policy"] == "sac"]
    np.testing.assert_allclose(own["return"], again["return"], rtol=1e-6)  # decimal numbers in the file
    lines = (out / "learned.md").read_text().splitlines()
    assert [line.split(" | ")[:2] for line in lines[2:4]] == [[f"| {START}", "ppo"], [f"| {START}", "sac"]]
    assert "Learned policies: cost, training and compute</h2>" in (out / "report.html").read_text()


def test_a_policy_flies_on_its_own_scenario_only(policies: Path) -> None:
    """An observation is scaled by its scenario, so a policy means nothing on another; beliefs do not count."""
    factory = Learned("mine", tuple(policies.glob(f"ppo_*{TENSORS}")))
    keeping = load_scenario("keeping")
    other = Scenario(**{**vars(keeping), "process_noise_m_s2": 0.0})
    found = factory(keeping, other)
    assert found is not None
    assert found.scenario == keeping
    assert factory(other, keeping) is None
    assert factory.settings(other) is None


def test_what_a_factory_tells_changes_with_the_policy(policies: Path) -> None:
    """Flights are kept by it, so it must tell any two policies apart."""
    initialization = load_scenario("initialization")
    ppo, sac = (Learned(name, (policies / f"{name}_initialization{TENSORS}",)) for name in ("ppo", "sac"))
    told = describe(ppo, initialization), describe(sac, initialization)
    assert told[0] != told[1]
    assert json.loads(json.dumps(told[0])) == told[0]


def test_fronts_fly_a_learned_policy_as_it_is(policies: Path) -> None:
    """It is not told the price of errors: at a hundred times the price, the same flights cost so much more for them."""
    learned = Learned("ppo", (policies / f"ppo_initialization{TENSORS}",))
    factory = pickle.loads(pickle.dumps(learned))  # as it gets to another process
    front = points({START: load_scenario("initialization")}, {"ppo": factory}, seeds("test", EPISODES), 0)
    cheap, dear = (front[f"{START} error_weight {value}"].run(lambda steps: None) for value in (0.1, 10))
    np.testing.assert_array_equal(cheap["delta_v_m_s"], dear["delta_v_m_s"])
    paid = [table["cost_m_s"] - table["delta_v_m_s"] for table in (cheap, dear)]
    np.testing.assert_allclose(paid[1], 100 * paid[0], rtol=1e-9)  # sums round differently


def test_two_policies_of_one_scenario_need_two_labels(policies: Path) -> None:
    """Else nobody could say which of them flew."""
    with pytest.raises(ConfigError, match=r"--model: mine: .* was trained on what another was, too"):
        Learned("mine", tuple(policies.glob(f"*_initialization{TENSORS}")))


def test_models_of_the_report_are_label_and_path() -> None:
    """A label may have several; it may not hide a classical policy."""
    assert parse_models(["a=x", "b=y", "a=z=1"]) == {"a": [Path("x"), Path("z=1")], "b": [Path("y")]}
    for wrong in ("runs/ppo", "=x", "a="):
        with pytest.raises(ConfigError, match="must be LABEL=PATH"):
            parse_models([wrong])
    with pytest.raises(ConfigError, match="'zero' is the name of a classical policy"):
        parse_models(["zero=x"])


def test_environments_follow_from_the_models(policies: Path, tmp_path: Path) -> None:
    """Ids where there is one, else scenarios' names; a file of one's own must be named."""
    path = policies / f"ppo_keeping{TENSORS}"
    other = write_policy(policies, "ppo", "bad_communication")
    assert envs_of({"mine": Learned("mine", (path, other))}) == [KEEPING, "bad_communication"]
    card = json.loads(path.with_suffix(CARD).read_text())
    card["env"], card["scenario"]["process_noise_m_s2"] = "mine.yaml", 0.0
    own = path.rename(policies / f"ppo_mine{TENSORS}")
    own.with_suffix(CARD).write_text(json.dumps(card))
    result = run("report", "--model", f"mine={own}", "--out", tmp_path / "out")
    assert result.exit_code == WRONG_INPUT
    assert "was trained on a scenario of its own; name its file" in result.stderr


def test_what_is_shipped_flies_where_it_was_trained(
    policies: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By default the registered ids, and scenarios that a shipped policy was trained on and that have no id."""
    write_policy(policies, "ppo", "bad_communication")
    flown: list[list[str]] = []
    monkeypatch.setattr(report, "write_report", lambda _, envs, *rest, **more: flown.append(list(envs)) or tmp_path)
    assert run("report", "--out", tmp_path).exit_code == 0
    assert run("report", KEEPING, "--out", tmp_path).exit_code == 0
    assert flown == [[*ENV_IDS, "bad_communication"], [KEEPING]]
    bad = load_scenario("bad_communication")
    assert library.load_policy("ppo", "bad_communication").scenario == bad


def test_a_model_that_flies_nowhere_is_a_mistake(policies: Path, tmp_path: Path) -> None:
    """Nothing flies then, and nothing is written."""
    path = policies / f"ppo_keeping{TENSORS}"
    result = run("report", "--model", f"mine={path}", START, "--out", tmp_path / "out")
    assert result.exit_code == WRONG_INPUT
    assert f"mine: {path} was trained on what the report leaves out" in result.stderr
    assert not (tmp_path / "out").exists()


def make_model(kind: type[BaseAlgorithm], folder: Path) -> tuple[BaseAlgorithm, Path]:
    """A model of a user's own that has never learnt."""
    memory = {} if kind is PPO else {"buffer_size": 10}
    model = kind("MlpPolicy", Sb3VecEnv(1, START), policy_kwargs={"net_arch": [8]}, seed=0, device="cpu", **memory)
    model.save(folder / "model.zip")
    return model, folder / "model.zip"


@pytest.mark.parametrize("kind", [PPO, SAC, TD3])
def test_a_model_of_ones_own_is_evaluated(kind: type[BaseAlgorithm], tmp_path: Path) -> None:
    """The printed means are those of the model flown here on the test seeds, to the four digits printed."""
    model, path = make_model(kind, tmp_path)
    assert algorithm_of(path) == kind.__name__
    options = [START, "--episodes", EPISODES, "--bound-episodes", 0, "--allow-pickle", "--throttle-power", 2]
    result = run("evaluate", path, *options)
    assert result.exit_code == 0, result.output
    assert "warning" in result.stderr
    printed = {line.split()[0]: line.split()[1:] for line in result.stdout.splitlines()[1:]}
    expected = summarise(evaluate(Sb3Policy(model, 2.0), START, seeds("test", EPISODES)))
    assert list(printed) == list(expected.index)
    for metric, line in expected.iterrows():
        means = [float(value) for value in printed[str(metric)][:3]]
        np.testing.assert_allclose(means, line.iloc[:3], rtol=1e-3, atol=1e-9)


def test_a_power_shapes_the_actions_of_a_model(tmp_path: Path) -> None:
    """At power 1 they are SB3's own."""
    model, _ = make_model(SAC, tmp_path)
    observations = np.random.default_rng(0).normal(size=(5, SIZE)).astype(np.float32)
    z, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(Sb3Policy(model, 1.0).predict(observations)[0], z)
    np.testing.assert_allclose(Sb3Policy(model, 2.0).predict(observations)[0], z * np.abs(z), rtol=1e-6)


def test_pickle_is_refused_without_the_flag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of the file is loaded; the line names the flag."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("loaded")

    _, path = make_model(PPO, tmp_path)
    monkeypatch.setattr(PPO, "load", refuse)
    result = run("evaluate", path, START)
    assert result.exit_code == WRONG_INPUT
    assert "holds pickled objects, which may run any code when they are loaded; give --allow-pickle" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_model_of_ones_own_enters_the_report(tmp_path: Path) -> None:
    """A .zip flies on the environments that are named, with the power that it is given; not without permission."""
    model, path = make_model(PPO, tmp_path)
    options = ReportOptions(episodes=EPISODES, slow_episodes=1, sweep_episodes=0)
    given = ([f"mine={path}"], [START], options, tmp_path / "out", "command", 1, ["lqr"])
    with pytest.raises(ConfigError, match="give --allow-pickle"):
        report.report_models(*given)
    with pytest.raises(ConfigError, match="does not name its environment"):
        report.report_models([f"mine={path}"], None, options, tmp_path / "out", "command", allow_pickle=True)
    with pytest.raises(ConfigError, match="needs a label of its own"):
        report.report_models([f"mine={path}"] * 2, [START], options, tmp_path / "out", "command", allow_pickle=True)
    assert not (tmp_path / "out").exists()
    report.report_models(*given, allow_pickle=True, throttle_power=2.0)
    table = pd.read_csv(tmp_path / "out" / "episodes.csv")
    expected = evaluate(Sb3Policy(model, 2.0), START, seeds("test", EPISODES))
    assert set(table["policy"]) == {"lqr", "mine"}
    np.testing.assert_allclose(table.loc[table["policy"] == "mine", "return"], expected["return"], rtol=1e-6)
    first = report.UserModel(path).settings(load_scenario("keeping"))
    assert first != report.UserModel(path, 2.0).settings(load_scenario("keeping"))


def test_a_shipped_file_is_evaluated_against_the_bound(policies: Path, tmp_path: Path) -> None:
    """Without a flag and without an environment; the last line is the mean of cost over bound, on fewer seeds."""
    options = ["--episodes", EPISODES, "--bound-episodes", 1, "--bounds", tmp_path / "bounds"]
    result = run("evaluate", policies / f"ppo_initialization{TENSORS}", *options)
    assert result.exit_code == 0, result.output
    name, ratio, low, high, count = result.stdout.splitlines()[-1].split()
    assert (name, count) == ("cost_over_bound", "1")
    assert float(ratio) == float(low) == float(high) > 1
    assert len(list((tmp_path / "bounds").iterdir())) == 1


def test_flying_elsewhere_is_noted(policies: Path) -> None:
    """A policy may be scored on a scenario that it was not trained on, but not by mistake."""
    options = ["--episodes", EPISODES, "--bound-episodes", 0]
    for env, noted in (("bad_communication", True), (KEEPING, False)):
        result = run("evaluate", policies / f"ppo_keeping{TENSORS}", *options, env)
        assert result.exit_code == 0, result.output
        assert ("was trained on another scenario than" in result.stderr) == noted


def foreign_model(folder: Path) -> Path:
    """A model of another environment."""
    PPO("MlpPolicy", "CartPole-v1", device="cpu").save(folder / "cartpole.zip")
    return folder / "cartpole.zip"


def test_faulty_sources_are_one_line(tmp_path: Path) -> None:
    """What is missing, damaged, of another algorithm or of another environment is named."""
    (tmp_path / "damaged.zip").write_text("no model")
    (tmp_path / "model.onnx").write_text("no tensors")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("data", json.dumps({"exploration_fraction": 0.1}))
    for source, fault in (
        (tmp_path / "missing.zip", "cannot be read: No such file"),
        (tmp_path / "damaged.zip", "no file of Stable-Baselines3"),
        (tmp_path / "other.zip", "of no algorithm that acts in these environments: PPO, SAC, TD3"),
        (foreign_model(tmp_path), r"observation space must have shape (38,), got (4,)"),
        (tmp_path / "model.onnx", "must end in .safetensors"),
        (tmp_path, "settings.json: cannot be read"),
    ):
        result = run("evaluate", source, START, "--allow-pickle")
        assert result.exit_code == WRONG_INPUT
        assert fault in result.stderr.splitlines()[-1]


def test_options_that_do_not_go_with_the_source_are_refused(policies: Path, tmp_path: Path) -> None:
    """A file that says its power is not told another; a .zip must be told where to fly."""
    result = run("evaluate", policies / f"ppo_keeping{TENSORS}", "--throttle-power", 2)
    assert result.exit_code == WRONG_INPUT
    assert "--throttle-power: only for a .zip" in result.stderr
    result = run("evaluate", make_model(PPO, tmp_path)[1])
    assert result.exit_code == WRONG_INPUT
    assert "does not say what it was trained on; name it" in result.stderr
