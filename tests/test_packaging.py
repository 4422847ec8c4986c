"""The wheel carries all that a user far from the checkout needs."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project's wheel, built by its own build backend from a copy of the sources."""
    source, target = tmp_path_factory.mktemp("source") / "project", tmp_path_factory.mktemp("wheel")
    source.mkdir()
    for name in ("formation_env", "baselines", "agents", "configs"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file() and not path.name.startswith("."):
            shutil.copy(path, source)
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)]
    subprocess.run(command, cwd=source, check=True, capture_output=True, timeout=120)
    (built,) = target.glob("*.whl")
    return built


def test_wheel_holds_the_packages_and_the_settings(wheel: Path) -> None:
    """Every YAML file of configs/ and every policy lies inside; the types are marked; the tests stay at home."""
    names = set(zipfile.ZipFile(wheel).namelist())
    settings = {path.relative_to(ROOT).as_posix() for path in (ROOT / "configs").rglob("*.yaml")}
    assert any(name.startswith("configs/scenarios/") for name in settings)
    assert {f"formation_env/{name}" for name in settings} <= names
    for package in ("formation_env", "baselines", "agents"):
        assert f"{package}/py.typed" in names
        modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / package).rglob("*.py")}
        assert modules <= names
    policies = {path.relative_to(ROOT).as_posix() for path in (ROOT / "agents" / "policies").rglob("*.*")}
    assert policies <= names
    assert not any(name.startswith(("tests/", "configs/")) or "__pycache__" in name for name in names)


def test_scenarios_load_from_the_unpacked_wheel(wheel: Path, tmp_path: Path) -> None:
    """Elsewhere, with only the wheel's content on the path: its scenarios, and an environment of each id."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    (tmp_path / "elsewhere").mkdir()
    code = (
        "import pathlib, gymnasium, formation_env as f;"
        "assert pathlib.Path(f.__file__).is_relative_to(pathlib.Path('../site').resolve()), f.__file__;"
        "names = f.scenario_names();"
        "[f.load_scenario(name) for name in names];"
        "[gymnasium.make(env_id) for env_id in f.ENV_IDS];"
        "print(len(names))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path / "elsewhere",
        env={"PYTHONPATH": str(tmp_path / "site"), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) == len(list((ROOT / "configs" / "scenarios").glob("*.yaml")))
