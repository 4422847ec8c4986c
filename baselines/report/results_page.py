"""The results as one Markdown page for the documentation: `results.md`."""

from collections.abc import Callable, Sequence

from baselines.experiments.statistics import Results
from baselines.report.table import NONE, markdown_row
from baselines.report.text import Cells, column, microseconds, number

BOUND_ROW = "perfect-information bound"
Content = Callable[[Results, list[str]], dict[str, str]]
"""From an environment and its policies to the text of each."""


def results_page(results: Sequence[Results], command: str = "make report") -> str:
    """The tables of all environments as Markdown: policies in rows, environments in columns.

    Args:
        results: of the environments.
        command: the command that makes the page; noted in it.
    """
    bound = {item.flown.label: number(float(item.bounds.mean())) for item in results if item.bounds is not None}
    sections = [
        "# Results",
        f"Made by `{command}`; do not edit. Means over the test seeds with 95 % intervals in brackets. ≈ marks "
        "estimates for all seeds from the few that a slow policy flew.",
        "## Mean cost in m/s",
        _table(results, _costs, bound),
        "## Cost over the perfect-information bound",
        _table([item for item in results if item.cost_ratios], _ratios),
        "## Paired difference of the cost to the best policy, m/s",
        _table(results, _differences),
        "## Time per action, µs",
        _table(results, _times),
        "## Episodes",
        _table(results, _episodes),
    ]
    return "\n\n".join(sections) + "\n"


def _table(results: Sequence[Results], content: Content, bound: dict[str, str] | None = None) -> str:
    names = _policies(results)
    columns = [(item.flown.label, content(item, [name for name in names if name in item.ranking])) for item in results]
    lines = [["policy", *(label for label, _ in columns)], ["---", *["---:"] * len(columns)]]
    if bound:
        lines.append([BOUND_ROW, *(bound.get(label, NONE) for label, _ in columns)])
    lines += [[f"`{name}`", *(cells.get(name, NONE) for _, cells in columns)] for name in names]
    return "\n".join(markdown_row(line) for line in lines)


def _policies(results: Sequence[Results]) -> list[str]:
    """All policies by their mean rank."""
    ranks: dict[str, list[int]] = {}
    for item in results:
        for rank, name in enumerate(item.ranking):
            ranks.setdefault(name, []).append(rank)
    return sorted(ranks, key=lambda name: sum(ranks[name]) / len(ranks[name]))


def _costs(results: Results, names: list[str]) -> dict[str, str]:
    return _marked(results, names, column([results.cost(name) for name in names]))


def _ratios(results: Results, names: list[str]) -> dict[str, str]:
    return _marked(results, names, column([results.cost_ratios[name] for name in names]))


def _differences(results: Results, names: list[str]) -> dict[str, str]:
    others = [name for name in names if name != results.best]
    cells = column([results.behind(results.best, name) for name in others])
    return {results.best: "best"} | {name: _cell(cell) for name, cell in zip(others, cells, strict=True)}


def _times(results: Results, names: list[str]) -> dict[str, str]:
    return {name: microseconds(results.flown.action_time_us(name)) for name in names if name in results.flown.flights}


def _episodes(results: Results, names: list[str]) -> dict[str, str]:
    return {name: str(results.count(name)) for name in names}


def _marked(results: Results, names: list[str], cells: Sequence[Cells | None]) -> dict[str, str]:
    partial = results.partial
    return {name: ("≈ " if name in partial else "") + _cell(cell) for name, cell in zip(names, cells, strict=True)}


def _cell(cell: Cells | None) -> str:
    if cell is None:
        return NONE
    mean, low, high = cell
    return mean if low == high else f"{mean} [{low}, {high}]"
