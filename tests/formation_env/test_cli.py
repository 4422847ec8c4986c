"""The command line: its grammar, its exit codes, and one line for every mistake."""

import importlib.metadata
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from cli_helpers import ROOT, environment, run_program, write_metadata
from typer.testing import CliRunner, Result

from formation_env.cli import app, with_group
from formation_env.cli_env import COMMANDS, to_yaml
from formation_env.cli_group import check_owner
from formation_env.settings import ConfigError, load_yaml
from formation_env.task.loading import ENV_IDS, load_scenario, scenario_names

LIGHT_START = """
import sys
from formation_env.__main__ import main
try:
    main()
except SystemExit:
    pass
print([name for name in ("numba", "scipy", "torch", "plotly", "matplotlib", "pandas") if name in sys.modules])
"""


@pytest.fixture
def metadata(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Installed metadata of this checkout."""
    folder = write_metadata(tmp_path / "site")
    monkeypatch.syspath_prepend(str(folder))
    return folder


def run(*arguments: str | Path) -> Result:
    """The result of `formation-env ARGUMENTS`."""
    return CliRunner().invoke(app, [*map(str, arguments)])


def assert_one_line(result: Result, code: int, text: str) -> None:
    """The command ended with this code and one line on stderr."""
    assert result.exit_code == code, result.output
    assert result.stderr.count("\n") == 1
    assert text in result.stderr


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_start_loads_no_heavy_library(option: str, metadata: Path) -> None:
    """Version and help come at once: neither numba nor any library of numbers, pictures or learning is loaded."""
    command = [sys.executable, "-c", LIGHT_START, option]
    found = subprocess.run(command, env=environment(metadata), capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.splitlines()[-1] == "[]"


def test_version_is_the_package_version(metadata: Path) -> None:
    """The version stands in the package and in the metadata of the installer."""
    assert run("--version").output == "formation-env 0.1.0\n"


def test_the_program_has_the_groups_of_other_packages(metadata: Path) -> None:
    """`env` is its own; `baselines` and `agents` come as entry points, each with its help."""
    shown = run_program(metadata, "--help")
    assert shown.returncode == 0, shown.stderr
    assert re.findall(r"^\W*(env|baselines|agents) ", shown.stdout, re.MULTILINE) == ["env", "baselines", "agents"]
    inside = run_program(metadata, "baselines", "list")
    assert inside.stdout == run_program(metadata, "list", module="baselines").stdout
    assert "lqr" in inside.stdout


def every_command() -> list[tuple[str, Any]]:
    """Name and command of all groups."""
    from agents.cli import app as agents
    from baselines.cli import app as baselines
    from formation_env.cli_env import app as env

    groups = {"env": env, "baselines": baselines, "agents": agents}
    return [
        (f"{group} {name}", command)
        for group, own in groups.items()
        for name, command in typer.main.get_group(own).commands.items()
    ]


def test_every_command_is_explained() -> None:
    """Each has a help, an example that calls it, and a help of each of its options."""
    found = every_command()
    assert len(found) == 10 + 6 + 8
    for name, command in found:
        assert command.help, name
        assert command.epilog.startswith(f"Example: formation-env {name}"), name
        unexplained = [each.name for each in command.params if not getattr(each, "help", None)]
        assert unexplained == [], name


def test_the_grammar_is_the_same_everywhere() -> None:
    """Environments are arguments, --resume is a flag; seeds, processes and folders have one meaning each."""
    texts: dict[str, set[str]] = {}
    for name, command in every_command():
        for each in command.params:
            if each.name in ("env", "envs"):
                assert each.param_type_name == "argument", name
            if each.name == "resume":
                assert each.is_flag, name
            if each.name in ("seed", "processes", "resume"):
                texts.setdefault(each.name, set()).add(each.help if name != "agents train" else "as train says")
    assert all(len(texts[name] - {"as train says"}) == 1 for name in texts)


@pytest.mark.parametrize(
    ("arguments", "now"),
    [
        (["check", "x.yaml"], "check: now formation-env env validate"),
        (["env", "scenarios"], "scenarios: now formation-env env list"),
        (["env", "observation"], "observation: now formation-env env show-observation"),
        (["validate", "x.yaml"], "validate: now formation-env env validate"),
        (["env", "bench", "--sb3"], "bench --sb3: now formation-env agents bench"),
        (["baselines", "reproduce"], "reproduce: now formation-env baselines thesis"),
        (["baselines", "render", "keeping"], "render: now formation-env env render"),
        (["baselines", "report", "--env", "keeping"], "report --env: now an argument"),
        (["baselines", "report", "--env=keeping"], "report --env: now an argument"),
        (["baselines", "sweep", "--env", "keeping"], "sweep --env: now an argument"),
        (["agents", "curve", "runs/a"], "curve: now formation-env agents plot-curves"),
        (["agents", "report", "--env", "keeping"], "report --env: now an argument"),
        (["agents", "evaluate", "a.zip", "--env", "keeping"], "evaluate --env: now an argument"),
        (["agents", "tune", "ppo", "keeping", "--study", "x"], "tune --study: now --out"),
        (
            ["agents", "train", "--resume", "."],
            "train --resume: now a flag, formation-env agents train --out . --resume",
        ),
    ],
)
def test_former_names_give_the_new_ones(arguments: list[str], now: str, metadata: Path) -> None:
    """One line, exit code 2."""
    assert_one_line(run(*arguments), 2, now)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["env", "nosuch"], "No such command 'nosuch'"),
        (["env", "list", "--nosuch"], "No such option"),
        (["env", "show", "keepin"], "did you mean 'keeping'?"),
        (["env", "show-observation", "keepin"], "did you mean 'keeping'?"),
        (["env", "bench", "keepin"], "did you mean 'keeping'?"),
        (["env", "render", "nosuch", "--out", "a.png"], "no scenario named 'nosuch'"),
        (["env", "render", "keeping", "--policy", "lqrr", "--out", "a.png"], "did you mean 'lqr'?"),
        (["env", "render", "keeping", "--out", "a.txt"], "--out: must end in .png, got a.txt"),
        (["env", "render", "keeping", "--steps", "-1", "--out", "a.png"], "--steps"),
        (["baselines", "report", "--episodes", "2000000"], "1000000; see root baselines report --help"),
        (["agents", "evaluate", "none.safetensors", "--episodes", "2000000"], "1000000"),
        (["agents", "evaluate", "none.zip", "keeping"], "none.zip: cannot be read"),
        (
            ["agents", "train", "ppo", "keeping", "--start", "none.safetensors"],
            "--start: none.safetensors: no such file",
        ),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str], fault: str, metadata: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, the fault is named, and nothing is written."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert_one_line(run(*arguments), 2, fault)
    assert list((tmp_path / "here").iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["baselines", "report", "keeping", "--out"],
        ["baselines", "sweep", "keeping", "--out"],
        ["baselines", "thesis", "--out"],
        ["baselines", "tune", "keeping", "--out"],
        ["baselines", "tune", "keeping", "--studies"],
        ["agents", "report", "keeping", "--out"],
        ["agents", "train", "ppo", "keeping", "--out"],
        ["agents", "tune", "ppo", "keeping", "--out"],
        ["agents", "export", "runs/a", "--out"],
        ["agents", "plot-curves", "runs/a", "--out"],
    ],
)
def test_an_unwritable_folder_is_named_before_the_work(arguments: list[str], metadata: Path, tmp_path: Path) -> None:
    """Exit code 1 within a moment: nothing has been flown, trained or read."""
    (tmp_path / "file").touch()
    out = tmp_path / "file" / "below"
    assert_one_line(run(*arguments, out), 1, f"error: {out}: cannot be written: Not a directory")


def test_a_long_flight_is_cut_and_says_so(metadata: Path, tmp_path: Path) -> None:
    """More steps than the episode has: a note, and the picture of its end."""
    path = tmp_path / "end.png"
    scenario = tmp_path / "short.yaml"
    scenario.write_text("phases: [{formation: {kind: following, y0_m: -100}, hold_orbits: 0.02}]\n")
    result = run("env", "render", scenario, "--steps", "100000", "--out", path)
    assert result.exit_code == 0, result.output
    assert (
        result.stderr
        == f"note: --steps: the episode has {load_scenario(scenario).num_steps} steps; the picture shows its end\n"
    )
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", scenario_names())
def test_show_prints_an_equal_scenario_with_all_keys(name: str, tmp_path: Path) -> None:
    """The YAML loads as the same scenario, and names each of its fields."""
    path = tmp_path / "shown.yaml"
    path.write_text(to_yaml(load_scenario(name)), encoding="utf-8")
    assert load_scenario(path) == load_scenario(name)
    assert set(load_yaml(path)) == set(vars(load_scenario(name)))


def test_list_and_observation() -> None:
    """All scenarios with their ids; the table, and the scales of an environment."""
    listed = run("env", "list").output
    assert [name for name in (*scenario_names(), *ENV_IDS) if name not in listed] == []
    assert "n = 0.00108" in run("env", "show-observation", "keeping").output
    assert "L = " not in run("env", "show-observation").output


def test_kinds_lists_formations_with_keys_and_defaults() -> None:
    """The seven formations and the dropout models; a key without a default is required."""
    from formation_env.dropout import DROPOUTS
    from formation_env.formations import FORMATIONS

    shown = run("env", "kinds").output
    assert [kind for kind in (*FORMATIONS, *DROPOUTS) if f"\n  {kind}\n" not in shown] == []
    assert re.search(r"\n    mean_outage_s +number, default 600.0", shown)


def test_schema_is_json_and_knows_the_keys() -> None:
    """Editors check keys with it."""
    schema = json.loads(run("env", "schema").output)
    assert set(vars(load_scenario("keeping"))) <= set(schema["properties"])


def test_validate_prints_size_and_authority(tmp_path: Path) -> None:
    """Facts of good files; the faults of bad ones on stderr, exit code 2."""
    bad = tmp_path / "bad.yaml"
    bad.write_text("phases: [{formation: {kind: following, y0_m: -100}, hold_orbits: -1}]\n")
    good = run("env", "validate", "keeping")
    assert good.exit_code == 0, good.output
    shown = {name: float(number) for name, number in re.findall(r"^  (\w+) +(\S+)$", good.stdout, re.MULTILINE)}
    keeping = load_scenario("keeping")
    assert shown["num_steps"] == keeping.num_steps
    assert shown["duration_s"] == keeping.num_steps * keeping.dt_s
    assert shown["period_s"] == pytest.approx(keeping.orbit.period_s, rel=1e-5)
    assert shown["delta_v_authority_m_s"] == pytest.approx(0.002 * shown["duration_s"], rel=1e-5)
    assert shown["max_range_m"] < shown["valid_range_m"]
    assert {"transfer_least_delta_v_m_s", "curvature_error_m"} <= set(shown)
    assert_one_line(run("env", "validate", bad), 2, f"{bad}: phases.0.hold_orbits: must be ")
    assert run("env", "validate", bad, "keeping").exit_code == 2


def test_validate_warns_of_what_the_models_cannot_describe(tmp_path: Path) -> None:
    """220 km behind the leader the linear equations are 3.5 km wrong, s^2 / (2 R); one line on stderr, exit code 0."""
    far = tmp_path / "far.yaml"
    far.write_text(
        "phases: [{formation: {kind: following, y0_m: -220e3}, hold_orbits: 1}]\nlimits: {max_distance_m: 1e6}\n"
    )
    result = run("env", "validate", far)
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith(f"{far}: warning: At 220 km")


def test_the_alias_takes_the_commands_of_env() -> None:
    """`python -m formation_env validate x` is `formation-env env validate x`."""
    assert all(with_group([name, "x"]) == ["env", name, "x"] for name in COMMANDS)
    assert with_group(["env", "list"]) == ["env", "list"]
    assert with_group(["--version"]) == ["--version"]


def test_a_closed_pipe_is_quiet(metadata: Path) -> None:
    """A reader that stops early, as `head` does, gets no traceback."""
    code = "from formation_env.__main__ import main; main()"
    command = [sys.executable, "-c", code, "env", "list"]
    with subprocess.Popen(
        command, env=environment(metadata), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""


def test_a_taken_name_is_one_line(metadata: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package `agents` of another distribution is named, its code is not run, and the rest of the program works."""
    other = tmp_path / "other" / "agents"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("raise SystemExit('ran')\n")
    info = tmp_path / "other" / "openai_agents-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.3\nName: openai-agents\nVersion: 1.0\n")
    (info / "RECORD").write_text("agents/__init__.py,,\n")
    path = {"PYTHONPATH": f"{tmp_path / 'other'}:{metadata}:{ROOT}"}
    code = "from formation_env.__main__ import main; main()"
    for arguments, status in ((["agents", "train"], 2), (["--help"], 0)):
        found = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            env={**environment(metadata), **path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        assert found.returncode == status, found.stderr
        assert "ran" not in found.stderr
        if status:
            told = "the name 'agents' is taken by openai-agents; install formation-env in an environment of its own"
            assert found.stderr == f"error: {told}\n"
        else:
            assert " baselines " in found.stdout


def test_our_own_packages_are_ours() -> None:
    """The marker stands in both."""
    check_owner("baselines")
    check_owner("agents")
    with pytest.raises(ConfigError, match="the name 'json' is taken by another package"):
        check_owner("json")


def test_without_other_packages_a_policy_cannot_be_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The package of the environments alone has no policies."""
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    result = run("env", "render", "keeping", "--policy", "lqr", "--out", tmp_path / "a.png")
    assert_one_line(result, 2, "--policy: no installed package offers policies")
