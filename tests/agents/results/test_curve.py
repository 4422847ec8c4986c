"""Pictures of learning curves: what is drawn is what the runs' files say."""

from pathlib import Path

import numpy as np
import pytest
from agents_helpers import PRETRAINED, assert_refused, small_run
from typer.testing import CliRunner

from agents.cli import app
from agents.results.curve import PRETRAINING, Levels, by_environment, figure_of, levels_of
from agents.training.run_folder import CURVE, read_curve, read_pretraining, start_run
from agents.training.train import train
from baselines import fuel_optimal, make_policy
from baselines.report import style
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds

EPISODES = 4


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Trainings of a second: PPO with pretraining and without, and SAC."""
    folder = tmp_path_factory.mktemp("runs")
    made = {"pretrained": ("ppo", PRETRAINED, 0), "ppo": ("ppo", "", 1), "sac": ("sac", "", 0)}
    for name, (algorithm, agent, seed) in made.items():
        train(small_run(folder, algorithm, agent, seed=seed, steps=256), folder / name)
    return {name: folder / name for name in made}


def test_one_picture_per_environment(runs: dict[str, Path], tmp_path: Path) -> None:
    """Both algorithms share it; it is a PNG, nothing else appears beside it, and drawn again it has the same bytes."""
    out, bounds = tmp_path / "new" / "pictures", tmp_path / "bounds"
    command = ["plot-curves", *map(str, runs.values()), "--out", str(out), "--bounds", str(bounds)]
    pictures = []
    for _ in range(2):
        result = CliRunner().invoke(app, command)
        assert result.exit_code == 0, result.output
        pictures.append((out / "learning_scenario.png").read_bytes())
    assert [path.name for path in out.iterdir()] == ["learning_scenario.png"]
    assert pictures[0].startswith(b"\x89PNG")
    assert pictures[0] == pictures[1]
    assert len(list(bounds.iterdir())) == EPISODES


def test_lines_are_those_of_the_files(runs: dict[str, Path]) -> None:
    """Pretraining left, learning right: minutes, and cost above the bound; policies in the report's colours."""
    (found,) = by_environment(list(runs.values())).values()
    figure = figure_of(found, Levels(0.25, {"lqr": 1.5}))
    left, right = figure.axes
    assert [axes.get_yscale() for axes in (left, right)] == ["log", "log"]
    judged, *curves = read_pretraining(runs["pretrained"]), *(read_curve(folder) for folder in runs.values())
    colors = {name: look.color for name, look in style.looks(["lqr", "ppo", "sac"]).items()} | {"both": PRETRAINING}
    for axes, tables, names in ((left, [judged], ["both"]), (right, curves, ["ppo", "ppo", "sac"])):
        *lines, level = axes.get_lines()
        assert [line.get_color() for line in (*lines, level)] == [colors[name] for name in (*names, "lqr")]
        assert set(level.get_ydata()) == {1.25}
        for line, table in zip(lines, tables, strict=True):
            np.testing.assert_allclose(line.get_xdata(), table["seconds"] / 60)
            np.testing.assert_allclose(line.get_ydata(), -table["return"] - 0.25)
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert [text.split(",")[0] for text in texts] == ["ppo", "sac", "lqr"]
    assert texts[0].startswith("ppo, 2 × 256 steps, best ")


def test_runs_without_pretraining_need_one_part(runs: dict[str, Path]) -> None:
    """As those of before there was such a file; without a bound the axis is the cost itself."""
    (found,) = by_environment([runs["ppo"]]).values()
    (axes,) = figure_of(found, Levels(None, {})).axes
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata(), -read_curve(runs["ppo"])["return"])
    assert axes.get_ylabel() == "mean cost, m/s"


def test_levels_are_of_the_validation_seeds(tmp_path: Path) -> None:
    """The bound and a classical policy, flown apart on the seeds that the curve was flown on."""
    run, judged = small_run(tmp_path, "ppo"), seeds("validation", EPISODES)
    levels = levels_of(run, ["lqr"], tmp_path / "bounds")
    bound = np.mean([fuel_optimal(run.scenario, seed=seed).cost for seed in judged])
    flown = evaluate(make_policy("lqr", run.scenario), run.scenario, judged)["return"].mean()
    assert levels.bound == pytest.approx(bound, rel=1e-9)
    assert levels.classical == {"lqr": pytest.approx(-flown, rel=1e-12)}


def test_what_cannot_be_drawn_is_one_line(runs: dict[str, Path], tmp_path: Path) -> None:
    """No run, no curve, an unknown policy, and runs of one name that flew something else."""
    start_run(small_run(tmp_path, "ppo"), tmp_path / "begun")
    (tmp_path / "other").mkdir()
    start_run(small_run(tmp_path / "other", "ppo", validation_episodes=8), tmp_path / "others")
    (tmp_path / "others" / CURVE).write_text("steps,seconds,return\n0,1,-1\n")
    for arguments, fault in (
        ([tmp_path / "none"], "settings.json: cannot be read"),
        ([tmp_path / "begun"], "validation.csv: cannot be read"),
        ([runs["ppo"], "--policy", "lqrr"], "did you mean 'lqr'?"),
        ([runs["ppo"], tmp_path / "others"], f"validation_episodes: differs from that of {runs['ppo']}"),
    ):
        assert_refused(["plot-curves", *map(str, (*arguments, "--out", tmp_path / "out"))], fault)
    assert not (tmp_path / "out").exists()
