"""The wheel carries all that a user far from the checkout needs."""

import configparser
import shutil
import subprocess
import sys
import tomllib
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


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel's content, as an installer leaves it."""
    site = tmp_path_factory.mktemp("site")
    zipfile.ZipFile(wheel).extractall(site)
    return site


def run_installed(site: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the program of the wheel's entry point, far from the checkout."""
    entry = "from formation_env.__main__ import main; main()"
    return subprocess.run(
        [sys.executable, "-P", "-c", entry, *arguments],
        cwd=cwd,
        env={"PYTHONPATH": str(site), "PATH": "", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_the_wheel_has_one_program_and_its_groups(installed: Path, tmp_path: Path) -> None:
    """`formation-env` is the only script; its groups are found through the wheel's metadata."""
    (info,) = installed.glob("*.dist-info")
    points = configparser.ConfigParser()
    points.read(info / "entry_points.txt")
    assert dict(points["console_scripts"]) == {"formation-env": "formation_env.__main__:main"}
    assert set(points["formation_env.commands"]) == {"baselines", "agents"}
    listed = run_installed(installed, tmp_path, "baselines", "list")
    assert listed.returncode == 0, listed.stderr
    assert "lqr_nominal" in listed.stdout


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (
            ["baselines", "tune", "keeping"],
            "tune: keeping: its settings belong to the installed package; give --out FOLDER",
        ),
        (
            ["agents", "export", "runs/a"],
            "export: the shipped policies belong to the installed package; give --out FOLDER",
        ),
    ],
)
def test_the_installed_package_is_not_written(
    installed: Path, tmp_path: Path, arguments: list[str], fault: str
) -> None:
    """From a wheel what comes with the package stays as it was installed."""
    before = {path: path.stat().st_mtime_ns for path in installed.rglob("*") if path.suffix in (".yaml", ".json")}
    found = run_installed(installed, tmp_path, *arguments)
    assert (found.returncode, found.stderr) == (2, f"error: {fault}\n")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert list(tmp_path.iterdir()) == []


def test_an_overwritten_package_is_named(wheel: Path, tmp_path: Path) -> None:
    """`pip install openai-agents` replaces agents/__init__.py, and its removal deletes that file: one line each."""
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    info = site / "openai_agents-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.3\nName: openai-agents\nVersion: 1.0\n")
    (info / "RECORD").write_text("agents/__init__.py,,\n")
    (site / "agents" / "__init__.py").write_text("raise SystemExit('ran')\n")
    found = run_installed(site, tmp_path, "agents", "report")
    told = "the name 'agents' is taken by openai-agents; install formation-env in an environment of its own"
    assert (found.returncode, found.stderr) == (2, f"error: {told}\n")
    (site / "agents" / "__init__.py").unlink()
    shutil.rmtree(info)
    found = run_installed(site, tmp_path, "agents", "report")
    assert found.returncode == 2
    missing = site / "agents" / "__init__.py"
    told = f"{missing}: missing, perhaps removed with another package; install formation-env again"
    assert found.stderr == f"error: {told}\n"
    assert run_installed(site, tmp_path, "env", "list").returncode == 0


def test_lower_bounds_are_those_that_were_tried() -> None:
    """Typer before 0.26 warns under today's Click, matplotlib before 3.10.7 under today's pyparsing, and so on."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bounds = dict(each.split(">=") for each in project["dependencies"])
    least = {"typer": (0, 26), "matplotlib": (3, 10, 7), "pandas": (2, 2, 2), "control": (0, 10, 1)}
    for name, version in least.items():
        assert tuple(map(int, bounds[name].split("."))) >= version, name
