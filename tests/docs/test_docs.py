"""README and docs: their code runs, their scenarios are valid, their commands, links, keys and defaults exist."""

import importlib
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
import typer
from ruamel.yaml import YAML

from baselines.report.results_page import results_page
from formation_env import ENV_IDS, SWARM_IDS, Scenario, load_scenario, scenario_names, swarm_names
from formation_env.dropout import DROPOUTS
from formation_env.evaluation import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.formations import FORMATIONS
from formation_env.kernel.metrics import METRICS
from formation_env.settings import build
from formation_env.task.observation import NEIGHBOUR_BLOCKS, markdown_table
from formation_env.task.phases import Phase
from formation_env.task.randomization import DomainRandomization

ROOT = Path(__file__).parents[2]
PAGES = {str(path.relative_to(ROOT)): path.read_text("utf-8") for path in [ROOT / "README.md", *ROOT.glob("docs/*.md")]}
ISOLATED = "docs/extending.md"
"""Its examples register things, which must not reach the other tests."""


def blocks(language: str) -> list[Any]:
    """Code blocks of a language on all pages, each named by its page and line."""
    found = []
    for page, text in PAGES.items():
        for block in re.finditer(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            line = text.count("\n", 0, block.start()) + 1
            found.append(pytest.param(page, block[1], id=f"{page}:{line}"))
    return found


def parse(cell: str) -> Any:
    """A value as YAML 1.2 reads it."""
    return YAML(typ="safe", pure=True).load(cell)


@pytest.mark.parametrize(("page", "code"), [b for b in blocks("python") if b.values[0] != ISOLATED])
def test_python_examples_run(page: str, code: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Every example runs as it stands."""
    exec(compile(code, page, "exec"), {})
    if "print(" in code:
        assert capsys.readouterr().out.strip()


def run_alone(code: str, folder: Path, packages: Path = ROOT) -> str:
    """Run an example in another process and in an empty folder; its output."""
    environment = {**os.environ, "PYTHONPATH": str(packages), "PYTHONWARNINGS": "error"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def apply(diff: str, root: Path) -> None:
    """Edit files as a diff says; what a hunk keeps and removes stands once in its file."""
    for part in re.split(r"^\+\+\+ ", diff, flags=re.MULTILINE)[1:]:
        name, *hunks = re.split(r"^@@\n", part, flags=re.MULTILINE)
        path = root / name.strip()
        text = path.read_text("utf-8")
        for hunk in hunks:
            lines = hunk.splitlines()
            old, new = ("\n".join(line[1:] for line in lines if line[0] in kinds) for kinds in (" -", " +"))
            assert text.count(old) == 1, f"{path}: {old}"
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")


EXTENSIONS = [block.values[1] for block in blocks("python") if block.values[0] == ISOLATED]


@pytest.mark.parametrize(
    "code", EXTENSIONS[:-1], ids=[re.findall(r"^class (\w+)|$", e, re.M)[0] for e in EXTENSIONS[:-1]]
)
def test_extensions_run(code: str, tmp_path: Path) -> None:
    """Formation, dropout model, controller and metric, each from outside the package, in a process of its own."""
    assert run_alone(code, tmp_path).strip()


def test_a_force_is_added(tmp_path: Path) -> None:
    """The diff of the last example in a copy of the package; then the example itself, which compares the two truths.

    J3's size: 2 m or so over the 20 minutes, a thousandth of J2's effect; hence more than a millimetre, less than 10 m.
    """
    (diff,) = blocks("diff")
    shutil.copytree(ROOT / "formation_env", tmp_path / "formation_env", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    apply(diff.values[1], tmp_path)
    assert 1e-3 < float(run_alone(EXTENSIONS[-1], tmp_path, packages=tmp_path)) < 10


@pytest.mark.parametrize(("page", "code"), blocks("yaml"))
def test_yaml_examples_are_scenarios(page: str, code: str, tmp_path: Path) -> None:
    """Every YAML block is a valid scenario."""
    path = tmp_path / "example.yaml"
    path.write_text(code, encoding="utf-8")
    load_scenario(path)


def test_the_readmes_episode_is_typical(capsys: pytest.CaptureFixture[str]) -> None:
    """The ten lines print the cost that the README says, within 1 % of the median of the 100 test seeds."""
    from baselines import make_policy

    code = re.search(r"```python\n(.*?)```", PAGES["README.md"], re.DOTALL)
    assert code is not None
    exec(compile(code[1], "README.md", "exec"), {})
    printed = capsys.readouterr().out.strip()
    assert f"prints `{printed}`" in PAGES["README.md"]
    costs = -evaluate(make_policy("lqr", "FormationKeeping-v0"), "FormationKeeping-v0", seeds("test", 100))["return"]
    assert float(printed.split()[1]) == pytest.approx(costs.median(), rel=0.01)


def test_observation_table_is_the_layout() -> None:
    """The tables are those that `formation-env env show-observation` prints, letter for letter."""
    assert markdown_table() in PAGES["docs/environment.md"]
    assert markdown_table(NEIGHBOUR_BLOCKS) in PAGES["docs/swarms.md"]


def test_environments_have_the_steps_that_the_table_says() -> None:
    """One line per registered id, with the number of its steps."""
    for env_id in ENV_IDS:
        (line,) = re.findall(rf"^\| `{env_id}` \|.*$", PAGES["docs/environment.md"], re.MULTILINE)
        assert line.split("|")[4].strip() == str(load_scenario(env_id).num_steps)


def test_names_are_complete() -> None:
    """All ids, scenarios and metrics stand where a reader looks for them."""
    assert [name for name in (*ENV_IDS, *SWARM_IDS) if f"`{name}`" not in PAGES["README.md"]] == []
    assert [name for name in (*scenario_names(), *swarm_names()) if f"`{name}`" not in PAGES["docs/scenarios.md"]] == []
    assert [name for name in METRICS if f"| `{name}` |" not in PAGES["docs/glossary.md"]] == []


def keys(prefix: str, cls: Any) -> dict[str, Any]:
    """Dotted keys of a settings class and their defaults; classes within are walked, registries are not."""
    found: dict[str, Any] = {}
    for field in fields(cls):
        default = None if field.default is MISSING else field.default
        if field.name == "kind" or field.name in ("leader_spacecraft", "domain_randomization", "phases"):
            continue
        if is_dataclass(default) and field.name != "formation" and field.name != "dropout":
            found |= keys(f"{prefix}{field.name}.", type(default))
        else:
            found[f"{prefix}{field.name}"] = "-" if field.default is MISSING else default
    return found


def test_scenario_keys_and_defaults() -> None:
    """docs/scenarios.md has every key with its default, and none that does not exist."""
    rows = re.findall(r"^\| `([a-z0-9_.]+)` \| (\S.*?) \| ", PAGES["docs/scenarios.md"], re.MULTILINE)
    said = {key: "-" if value == "-" else parse(value) for key, value in rows if value[0] != "`"}
    known = keys("", Scenario) | keys("phases.", Phase) | keys("domain_randomization.", DomainRandomization)
    known["dropout.kind"] = known.pop("dropout").kind
    known["start.formation"] = {"kind": known["start.formation"].kind}
    for registry in (FORMATIONS, DROPOUTS):
        for kind, cls in registry.items():
            known |= keys(f"{kind}.", cls)
    known["inter_satellite_link.dropout"] = {"kind": known["inter_satellite_link.dropout"].kind}
    known["follower_settings"] = []
    known["windows.windows"] = [{"start_s": 0, "duration_s": 3000}]
    known |= {"at_leader": "-"}
    shipped = {*scenario_names(), *swarm_names()}
    assert {key: value for key, value in said.items() if key not in shipped} == known


def test_every_shipped_kind_builds_from_its_documented_keys() -> None:
    """The kinds of the tables are those of the registries."""
    for name, registry in (("scenarios", FORMATIONS), ("models", DROPOUTS)):
        for kind, cls in registry.items():
            assert re.search(rf"`{kind}[.`]", PAGES[f"docs/{name}.md"])
            required = {"formations": [{"kind": "at_leader"}]} if kind == "list" else {}
            assert build(cls, {"kind": kind, **required}, "docs").kind == kind


def program() -> Any:
    """The program `formation-env` as a tree of click commands."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    root = typer.main.get_command(importlib.import_module("formation_env.cli").app)
    for name, entry in project["entry-points"]["formation_env.commands"].items():
        module, app = entry.split(":")
        root.commands[name] = typer.main.get_command(getattr(importlib.import_module(module), app))  # type: ignore[attr-defined]
    return root


def check_program(arguments: list[str]) -> None:
    """Every command on the way exists, and every option is one of the last command's."""
    command, rest = program(), list(arguments)
    while hasattr(command, "commands"):
        assert rest, "a command is missing"
        assert rest[0] in command.commands, rest[0]
        command = command.commands[rest.pop(0)]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    assert {argument for argument in rest if argument.startswith("--")} <= known


def check_line(line: str) -> None:
    """One line of a console block names what exists."""
    program_name, *arguments = shlex.split(line, comments=True)
    if program_name == "formation-env":
        check_program(arguments)
    elif program_name == "make":
        assert re.search(rf"^{arguments[0]}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    elif program_name == "python":
        assert arguments[0] == "-m"
        assert importlib.util.find_spec(arguments[1])
    else:
        assert (program_name, arguments[0]) == ("pip", "install")
        extras = re.search(r"\[(.*)\]", arguments[-1])
        known = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
        assert extras is not None
        assert set(extras[1].split(",")) <= set(known)


@pytest.mark.parametrize(("page", "code"), blocks("console"))
def test_console_examples_exist(page: str, code: str) -> None:
    """Commands, options, make's targets, modules and extras of every console block exist."""
    for line in code.splitlines():
        check_line(line)


def slug(heading: str) -> str:
    """GitHub's anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    """Every relative link is a file, and every anchor a heading."""
    for target in re.findall(r"\]\(([^)\s]+)\)", PAGES[page]):
        if target.startswith("http"):
            continue
        name, _, anchor = target.partition("#")
        path = (ROOT / page).parent / name if name else ROOT / page
        assert path.exists(), target
        if anchor:
            text = path.read_text("utf-8")
            assert anchor in [slug(heading) for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)], target


def test_index_links_every_page() -> None:
    """No page is an orphan."""
    pages = {Path(page).name for page in PAGES} - {"README.md", "index.md"}
    assert [page for page in sorted(pages) if f"({page})" not in PAGES["docs/index.md"]] == []


def tables(text: str) -> list[str]:
    """All Markdown tables of a text."""
    return re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)


def test_results_stand_once() -> None:
    """README's table is the first one of docs/results.md, which `make results` writes; no other page has these rows."""
    (block,) = re.findall(r"<!-- results:begin -->\n(.*?)<!-- results:end -->", PAGES["README.md"], re.DOTALL)
    first = tables(PAGES["docs/results.md"])[0]
    assert block == first
    assert re.search(
        r"^Made by `.*agents report --episodes 100 .*`; do not edit", PAGES["docs/results.md"], re.MULTILINE
    )
    headings = re.findall(r"^## .*", PAGES["docs/results.md"], re.MULTILINE)
    assert headings == [*re.findall(r"^## .*", results_page([]), re.MULTILINE), "## Learned policies"]
    rows = {row for row in first.splitlines() if "[" in row}
    for page in PAGES.keys() - {"README.md", "docs/results.md"}:
        assert not rows & set(PAGES[page].splitlines())
