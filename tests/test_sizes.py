"""Files and functions are short enough to be read at once; one that is not says why."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("formation_env", "baselines", "agents")
MOST_LINES_OF_A_FILE = 250
MOST_LINES_OF_A_FUNCTION = 40
REASON = "# Long: "
"""How the comment begins that stands above a longer function, or on top of a longer file, and gives the reason."""


def sources() -> Iterator[tuple[str, str]]:
    """Name and text of every source file."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")


def test_files_are_short() -> None:
    """A file is one idea."""
    long = [
        f"{name}: {len(text.splitlines())} lines"
        for name, text in sources()
        if len(text.splitlines()) > MOST_LINES_OF_A_FILE and REASON not in text
    ]
    assert long == []


def test_functions_are_short() -> None:
    """A function fits on a screen, its documentation aside."""
    long = []
    for name, text in sources():
        lines = text.splitlines()
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            documented = isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant)
            first = node.body[0].end_lineno if documented else node.body[0].lineno - 1
            length = (node.end_lineno or 0) - (first or 0)
            above = lines[min(node.lineno, *(d.lineno for d in node.decorator_list), node.lineno) - 2]
            if length > MOST_LINES_OF_A_FUNCTION and not above.strip().startswith(REASON):
                long.append(f"{name}:{node.lineno} {node.name}: {length} lines")
    assert long == []
