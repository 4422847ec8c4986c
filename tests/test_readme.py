"""The README says what is so."""

import re
from pathlib import Path

import pytest

from formation_env import ENV_IDS, load_scenario, scenario_names
from formation_env.task.observation import markdown_table
from formation_env.task.variants import draw_variants

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """Code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_observation_table_is_the_layout() -> None:
    """The table is the one that the layout object prints, letter for letter."""
    assert markdown_table() in README


@pytest.mark.parametrize("example", blocks("python"))
def test_examples_run(example: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Every Python example runs as it stands, and prints its numbers."""
    exec(compile(example, "README.md", "exec"), {})
    assert "delta_v_m_s" in capsys.readouterr().out


def test_scenario_example_loads(tmp_path: Path) -> None:
    """The YAML example is a valid scenario."""
    (example,) = blocks("yaml")
    path = tmp_path / "example.yaml"
    path.write_text(example, encoding="utf-8")
    scenario = load_scenario(path)
    assert scenario.sensor.measures == "position"
    assert len(draw_variants(scenario)) == 64


def test_everything_is_named_and_pictures_exist() -> None:
    """All ids and scenarios stand in the README, and what it shows is there."""
    assert [name for name in (*ENV_IDS, *scenario_names()) if f"`{name}`" not in README] == []
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README, re.DOTALL)
    assert pictures
    assert all((Path(__file__).parents[1] / picture).is_file() for picture in pictures)
