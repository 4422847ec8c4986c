"""The architecture: which module may import which, read from the sources without running them."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("formation_env", "baselines", "agents")

# Each package may import itself and those before it. Inside a package each line may import itself and the lines above;
# a new folder takes its place here. `rendering` stands beside the kernel, whose simulation it draws, and knows no
# environment; what the environments tell Gymnasium about rendering is a module that needs nothing.
LAYERS = {
    "formation_env": (
        {
            "numerics",
            "configuration",
            "files",
            "lazy",
            "quantities",
            "registration",
            "settings",
            "rendering.modes",
        },
        {"orbital"},
        {"dynamics"},
        {"formations", "dropout", "navigation"},
        {"task"},
        {"kernel"},
        {"rendering"},
        {"envs"},
        {"evaluation"},
        {"", "__main__", "cli", "cli_bench", "cli_env", "cli_errors", "cli_group", "cli_options", "cli_policies"},
    ),
    "baselines": (
        {"design", "result_cache"},
        {"optimal"},
        {"controllers"},
        {"swarm"},
        {"experiments"},
        {"report", "tuning"},
        {"thesis"},
        {"cli", "cli_report", "cli_tune"},
        {"", "__main__"},
    ),
    "agents": (
        {"policy", "hyperparameters"},
        {"algorithms", "examples"},
        {"pretraining"},
        {"training"},
        {"results", "tuning"},
        {"cli", "cli_results"},
        {"", "__main__"},
    ),
}
LEARNING = {"stable_baselines3", "torch", "ray", "tensorboard"}
PLOTTING = {"matplotlib", "plotly"}


@dataclass(frozen=True)
class Import:
    """One module's import of another.

    Attributes:
        source: dotted name of the importing module.
        target: dotted name of what it imports.
        lazy: whether it happens inside a function only.
        line: where.
    """

    source: str
    target: str
    lazy: bool
    line: int

    def __str__(self) -> str:
        return f"{self.source}:{self.line} imports {self.target}"


def module_name(path: Path) -> str:
    """Dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))}


def is_for_types_only(node: ast.AST) -> bool:
    """Whether this is `if TYPE_CHECKING:`, which never runs."""
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def statements(tree: ast.AST, lazy: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Every import statement below a node, and whether it is inside a function."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, lazy
        elif not is_for_types_only(node):
            yield from statements(node, lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))


def targets(node: ast.Import | ast.ImportFrom) -> list[str]:
    """The modules that a statement imports: `from package import name` is `package.name` if that is a module."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    assert node.module is not None, "imports are absolute"
    assert node.level == 0, "imports are absolute"
    names = [f"{node.module}.{alias.name}" for alias in node.names]
    return [name if name in FILES else node.module for name in names]


IMPORTS = [
    Import(source, target, lazy, node.lineno)
    for source, path in FILES.items()
    for node, lazy in statements(ast.parse(path.read_text(encoding="utf-8")))
    for target in targets(node)
]


def package(module: str) -> str:
    """The first part of a dotted name."""
    return module.split(".")[0]


def layer(module: str) -> int:
    """Where a module stands among the layers of its package."""
    layers, inside = LAYERS[package(module)], module.partition(".")[2]
    room = inside if any(inside in members for members in layers) else inside.split(".")[0]
    places = [index for index, members in enumerate(layers) if room in members]
    assert places, f"give {module} its place in LAYERS"
    return places[0]


PICTURES = (
    "formation_env.rendering",
    "formation_env.evaluation.snapshot",
    "baselines.report",
    "baselines.thesis.models",
    "baselines.thesis.thesis_page",
    "baselines.thesis.write_thesis",
    "agents.results.curve",
)
"""Modules that plot, and those of the thesis whose names say so."""
WITHOUT_PICTURES = ("formation_env.rendering", "formation_env.rendering.modes", "formation_env.rendering.moment")


def draws(module: str) -> bool:
    """Whether a module is one of those that plot: rendering, of a report or of a curve."""
    if module in WITHOUT_PICTURES:
        return False
    return module.startswith(PICTURES) or any(part.startswith(("report", "figures")) for part in module.split("."))


def test_the_sources_are_read() -> None:
    """The parser sees imports at both levels, and submodules behind `from package import name`."""
    assert {package(name) for name in FILES} == set(PACKAGES)
    seen = {(found.source, found.target, found.lazy) for found in IMPORTS}
    assert ("formation_env.kernel.stages.kalman_filter", "formation_env.kernel.kalman", False) in seen
    assert ("formation_env.configuration.config_files", "formation_env.configuration.yaml_loader", True) in seen


def test_packages_import_one_way() -> None:
    """formation_env <- baselines <- agents, inside functions too."""
    wrong = [
        str(found)
        for found in IMPORTS
        if package(found.target) in PACKAGES
        and PACKAGES.index(package(found.target)) > PACKAGES.index(package(found.source))
    ]
    assert wrong == []


@pytest.mark.parametrize("owner", PACKAGES)
def test_layers_import_downwards(owner: str) -> None:
    """From ideas to use, inside functions too; only `render`, which draws, is fetched from below when it is called."""
    inside = [found for found in IMPORTS if {package(found.source), package(found.target)} == {owner}]
    assert inside
    wrong = [
        str(found)
        for found in inside
        if layer(found.target) > layer(found.source) and not (found.lazy and draws(found.target))
    ]
    assert wrong == []


def test_no_imports_run_in_circles() -> None:
    """Files can be put in an order in which each imports only files before it; inside functions and for types, too."""
    graph = {
        source: {
            target
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for target in targets(node)
            if target in FILES and target != source
        }
        for source, path in FILES.items()
    }
    assert len(list(TopologicalSorter(graph).static_order())) == len(FILES)


@pytest.mark.parametrize("owner", ["formation_env", "baselines"])
def test_learning_libraries_stay_out(owner: str) -> None:
    """Nobody needs an RL library to import the environments or the classical policies."""
    wrong = [
        str(found)
        for found in IMPORTS
        if package(found.source) == owner and package(found.target) in LEARNING and not found.lazy
    ]
    assert wrong == []


def test_learned_policies_fly_without_learning_libraries() -> None:
    """Whatever the command line, the report, the shipped policies and their evaluation import, directly or not."""
    needed, found = (
        {"agents.cli", "agents.results.report", "agents.policy.library", "agents.results.evaluate"},
        set(),
    )
    while needed:
        module = needed.pop()
        found.add(module)
        parents = {module.rpartition(".")[0]} - {""}
        needed |= ({item.target for item in IMPORTS if item.source == module and not item.lazy} | parents) - found
    assert {"agents.policy.actor", "agents", "baselines.report"} <= found
    assert {package(module) for module in found} & (LEARNING | {"onnx"}) == set()


def test_plotting_is_loaded_by_those_who_plot() -> None:
    """matplotlib and plotly: inside functions, or in rendering and report modules, themselves loaded in functions."""
    wrong = [
        str(found)
        for found in IMPORTS
        if not found.lazy
        and not draws(found.source)
        and (package(found.target) in PLOTTING or (found.target in FILES and draws(found.target)))
    ]
    assert wrong == []
