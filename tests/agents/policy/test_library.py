"""Shipped policies: each is what its card says, flies as its card says, and is refused once anything has changed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from actor_helpers import assert_equal_up_to_rounding, rounding_bound
from agents_helpers import PRETRAINED, small_run
from typer.testing import CliRunner

from agents import Actor, load_policy
from agents.cli import app
from agents.policy import library
from agents.policy.actor import Functions, read_actor
from agents.policy.library import CARD, GRAPH, TENSORS, load_with_card, read_card, shipped_paths
from agents.policy.onnx_export import to_onnx
from agents.results.export import export
from agents.training.run_folder import BEST, START, load_best, read_pretraining
from agents.training.train import train
from formation_env import ConfigError, FormationVectorEnv, load_scenario
from formation_env.cli_errors import WRONG_INPUT
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.task.observation import SIZE

ENV = "FormationInitialization-v0"
NAME = "ppo_initialization"
REFLOWN_TOLERANCE = 1e-3
"""Relative: rounding differs from processor to processor, and an episode feeds it back some hundred times."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two trainings of a second, by their seeds."""
    folder = tmp_path_factory.mktemp("runs")
    for seed in (0, 1):
        run = small_run(folder, "ppo", env=ENV, seed=seed, steps=256, validations=1)
        assert train(run, folder / str(seed)) == "finished"
    return [folder / "0", folder / "1"]


@pytest.fixture(scope="module")
def exported(runs: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both exported by the command; the path of the tensors."""
    out = tmp_path_factory.mktemp("policies")
    result = CliRunner().invoke(app, ["export", *map(str, runs), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert str(out / f"{NAME}{TENSORS}") in result.output
    return out / f"{NAME}{TENSORS}"


@pytest.fixture
def copy(exported: Path, tmp_path: Path) -> Path:
    """The exported policy, to be spoilt."""
    for ending in (TENSORS, CARD):
        (tmp_path / f"{NAME}{ending}").write_bytes(exported.with_suffix(ending).read_bytes())
    return tmp_path / f"{NAME}{TENSORS}"


def change_card(path: Path, **changes: Any) -> None:
    card = path.with_suffix(CARD)
    card.write_text(json.dumps(json.loads(card.read_text()) | changes))


def check_graph(path: Path) -> None:
    """A second runtime gives the actions of the first, on observations of an episode and on wild ones."""
    actor = load_policy(path)
    env = FormationVectorEnv(64, actor.scenario)
    flown = [env.reset(seed=1)[0]]
    for _ in range(20):
        flown.append(env.step(actor.predict(flown[-1])[0])[0])
    wild = np.random.default_rng(2).normal(0, 3, (64, SIZE)).astype(np.float32)
    session = onnxruntime.InferenceSession(path.with_suffix(GRAPH), providers=["CPUExecutionProvider"])
    assert [(item.name, item.type, item.shape) for item in session.get_inputs()] == [
        ("observation", "tensor(float)", ["N", SIZE])
    ]
    for observations in (np.concatenate(flown), wild, wild[:1]):
        (actions,) = session.run(["action"], {"observation": observations})
        assert_equal_up_to_rounding(actions, actor.predict(observations)[0], rounding_bound(actor, observations))


def unused_initializers(content: bytes) -> set[str]:
    """Constants of an ONNX graph that no node reads; onnxruntime warns of each."""
    graph = onnx.load_from_string(content).graph
    return {tensor.name for tensor in graph.initializer} - {name for node in graph.node for name in node.input}


def check_card(path: Path) -> None:
    """The first test seeds, flown again, cost what the card says."""
    actor, card = load_with_card(path)
    costs = -evaluate(actor, card.env, seeds("test", len(card.first_test_costs_m_s)))["return"]
    np.testing.assert_allclose(costs, card.first_test_costs_m_s, rtol=REFLOWN_TOLERANCE)


@pytest.mark.parametrize("path", shipped_paths(), ids=lambda path: path.stem)
def test_shipped_policies_fly_as_their_cards_say(path: Path) -> None:
    """Each shipped policy is whole, for today's environment, named after it, and as good as it was."""
    check_card(path)
    check_graph(path)
    actor, card = load_with_card(path)
    assert path.with_suffix(GRAPH).read_bytes() == to_onnx(actor)
    assert path.stem == library.policy_name(card.algorithm, card.env)
    assert path.stat().st_size < 1e6


def test_an_exported_policy_flies_as_its_card_says(exported: Path) -> None:
    """The same for a fresh one, and the five costs are those of its hundred test episodes."""
    check_card(exported)
    check_graph(exported)
    actor, card = load_with_card(exported)
    table = evaluate(actor, ENV, seeds("test", card.test_episodes))
    assert card.test["return"].mean == pytest.approx(table["return"].mean(), rel=1e-6)
    assert card.runs[0].test_cost_m_s.mean == pytest.approx(-table["return"].mean(), rel=1e-6)
    assert sorted(found.suffix for found in exported.parent.iterdir()) == sorted((TENSORS, CARD, GRAPH))


def test_the_run_best_on_validation_is_shipped(runs: list[Path], exported: Path) -> None:
    """Validation chooses, whatever the test says; all runs stand in the card, with mean and interval by hand."""
    card = load_with_card(exported)[1]
    costs = {run.seed: run.validation_cost_m_s for run in card.runs}
    best = min(costs, key=lambda seed: costs[seed])
    assert card.runs[0].seed == card.training["seed"] == best
    chosen = load_best(runs[best])[1]
    flown = evaluate(chosen, ENV, seeds("validation", 500))["return"].mean()
    assert costs[best] == pytest.approx(-flown, rel=1e-6)
    assert [run.steps for run in card.runs] == [256, 256]
    one, two = (run.test_cost_m_s.mean for run in card.runs)
    over = card.cost_over_runs_m_s
    assert over is not None
    assert over.mean == pytest.approx((one + two) / 2)
    assert over.high - over.mean == pytest.approx(12.7062 * abs(one - two) / 2, rel=1e-5)  # Student's t, one degree


def test_the_card_has_the_time_of_pretraining(tmp_path: Path) -> None:
    """None went by without pretraining, its last judgement says it else, and of a given actor nobody knows it."""
    small = {"steps": 128, "validations": 1}
    train(small_run(tmp_path, "ppo", PRETRAINED, seed=1, **small), tmp_path / "pretrained")
    train(small_run(tmp_path, "ppo", start=tmp_path / "pretrained" / START, seed=2, **small), tmp_path / "started")
    train(small_run(tmp_path, "ppo", seed=3, **small), tmp_path / "new")
    judged = read_pretraining(tmp_path / "pretrained")
    assert judged is not None
    path = export([tmp_path / name for name in ("pretrained", "started", "new")], tmp_path / "out")
    found = {run.seed: run.pretraining_s for run in read_card(path.with_suffix(CARD)).runs}
    assert found == {1: pytest.approx(judged["seconds"].iloc[-1]), 2: None, 3: 0.0}
    assert judged["seconds"].iloc[-1] > 0


def test_the_card_has_what_was_learnt_after_the_start(tmp_path: Path) -> None:
    """Cost of the start less cost of the best policy, both flown here; none where there was no actor to start from."""
    small = {"steps": 256, "validations": 2}
    train(run := small_run(tmp_path, "ppo", PRETRAINED, seed=1, **small), tmp_path / "pretrained")
    train(small_run(tmp_path, "ppo", seed=3, **small), tmp_path / "new")
    path = export([tmp_path / "pretrained", tmp_path / "new"], tmp_path / "out")
    saved = {trained.seed: trained.saved_m_s for trained in read_card(path.with_suffix(CARD)).runs}
    flown = [
        evaluate(read_actor(tmp_path / "pretrained" / name, run.scenario), run.scenario, seeds("test", 100))["return"]
        for name in (BEST, START)
    ]
    assert saved[3] is None
    assert saved[1] is not None
    assert saved[1].mean == pytest.approx((flown[0] - flown[1]).mean(), rel=1e-6)
    assert saved[1].low <= saved[1].mean <= saved[1].high


@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
@pytest.mark.parametrize("squash", ["clip", "tanh"])
def test_graphs_of_all_functions(activation: str, squash: str) -> None:
    """onnxruntime is the oracle of each activation and squash, at a power that is no integer."""
    rng = np.random.default_rng(4)
    shapes = ((9, SIZE), (9,)), ((3, 9), (3,))
    layers = [tuple(rng.normal(0, 0.3, shape).astype(np.float32) for shape in pair) for pair in shapes]
    actor = Actor(layers, Functions(activation, squash, 2.5), load_scenario("keeping"))
    observations = rng.normal(0, 1, (50, SIZE)).astype(np.float32)
    assert unused_initializers(to_onnx(actor)) == set()
    (actions,) = onnxruntime.InferenceSession(to_onnx(actor)).run(None, {"observation": observations})
    assert_equal_up_to_rounding(actor.predict(observations)[0], actions, rounding_bound(actor, observations))
    assert (np.abs(actions).max(axis=0) > 0.5).all()


def test_policies_load_by_name_or_path(exported: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By algorithm and id or scenario's name, and by path."""
    monkeypatch.setattr(library, "SHIPPED", exported.parent)
    observation = np.zeros(SIZE, np.float32)
    expected = read_actor(exported, load_scenario("initialization")).predict(observation)[0]
    for policy in (load_policy("ppo", ENV), load_policy("ppo", "initialization"), load_policy(str(exported))):
        np.testing.assert_array_equal(policy.predict(observation)[0], expected)
        assert policy.scenario == load_scenario("initialization")
    with pytest.raises(ConfigError, match=f"no policy of 'pqo' for '{ENV}' is shipped; did you mean '{NAME}'?"):
        load_policy("pqo", ENV)
    with pytest.raises(ConfigError, match=r"must end in \.safetensors, or be an algorithm"):
        load_policy("ppo")


def test_changed_tensors_are_refused(copy: Path) -> None:
    """One bit of one weight."""
    content = bytearray(copy.read_bytes())
    content[-1] ^= 1
    copy.write_bytes(content)
    with pytest.raises(ConfigError, match=r"sha256 is .*, but its card says .*; do not fly it"):
        load_policy(copy)


def test_another_version_or_scenario_is_refused(copy: Path) -> None:
    """An environment that has moved on is named, with what has changed in it."""
    change_card(copy, env="FormationInitialization-v9")
    with pytest.raises(ConfigError, match="was trained on FormationInitialization-v9, which does not exist; did"):
        load_policy(copy)
    change_card(copy, env="FormationKeeping-v0")
    with pytest.raises(ConfigError, match=r"was trained on another FormationKeeping-v0: .*phases.* changed since"):
        load_policy(copy)
    change_card(copy, env=ENV, observation_size=37)
    with pytest.raises(ConfigError, match="reads 37 observations, the environment gives 38"):
        load_policy(copy)


def test_a_policy_for_a_scenario_of_ones_own_carries_it(copy: Path) -> None:
    """Its file may be anywhere; the card has the scenario."""
    change_card(copy, env="somewhere/mine.yaml")
    assert load_policy(copy).scenario == load_scenario("initialization")


def test_faulty_cards_are_one_line(copy: Path) -> None:
    """A missing card, one that is no JSON, and one with a wrong key."""
    change_card(copy, wide=1)
    with pytest.raises(ConfigError, match=r"\.json: wide: unknown key"):
        load_policy(copy)
    copy.with_suffix(CARD).write_text("{")
    with pytest.raises(ConfigError, match=r"\.json: no valid JSON"):
        load_policy(copy)
    copy.with_suffix(CARD).unlink()
    with pytest.raises(ConfigError, match=r"\.json: cannot be read"):
        load_policy(copy)


def test_runs_that_do_not_belong_together_are_refused(runs: list[Path], tmp_path: Path) -> None:
    """The same seed twice, and a folder without a run: one line, nothing written."""
    for folders, fault in (
        ([runs[0], runs[0]], "has the training seed 0, as"),
        ([tmp_path], "settings.json: cannot be read"),
    ):
        result = CliRunner().invoke(app, ["export", *map(str, folders), "--out", str(tmp_path / "out")])
        assert result.exit_code == WRONG_INPUT
        assert fault in result.stderr
        assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_card_is_renewed_by_flying_again(copy: Path) -> None:
    """Test results of another environment's numbers are replaced; what is said of the training runs stays."""
    card = copy.with_suffix(CARD)
    right = json.loads(card.read_text(encoding="utf-8"))
    stale = json.loads(card.read_text(encoding="utf-8"))
    stale["first_test_costs_m_s"] = [1.0] * 5
    stale["test"]["return"] = {"mean": -1.0, "low": -1.0, "high": -1.0}
    card.write_text(json.dumps(stale), encoding="utf-8")
    result = CliRunner().invoke(app, ["renew", str(copy)])
    assert result.exit_code == 0, result.output
    assert json.loads(card.read_text(encoding="utf-8")) == right
