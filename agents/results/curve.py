"""Plots of learning curves: validation cost over wall time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from agents.algorithms.registry import ALGORITHMS
from agents.policy.library import scenario_name
from agents.results.evaluate import least_costs
from agents.training.run_folder import Run, load_run, read_curve, read_pretraining
from agents.training.validation import validate
from baselines import make_policy
from baselines.report.style import looks
from formation_env.evaluation.seeds import seeds
from formation_env.files import replacing
from formation_env.settings import ConfigError

DASHES: Final = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
"""The report's dashes under matplotlib's names."""
PRETRAINING: Final = "#333333"
"""Colour of the pretraining, which all algorithms share."""


@dataclass(frozen=True)
class TrainingCurve:
    """Learning curve of a run.

    Attributes:
        folder: of the run.
        run: its settings.
        pretraining: validations during pretraining; None if there is no log.
        curve: validations during reinforcement learning.
    """

    folder: Path
    run: Run
    pretraining: pd.DataFrame | None
    curve: pd.DataFrame

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return scenario_name(self.run.env)


@dataclass(frozen=True)
class Levels:
    """Reference costs on the same validation seeds.

    Attributes:
        bound: mean perfect-information bound, m/s; None if unknown.
        classical: mean cost of classical policies by name, m/s.
    """

    bound: float | None
    classical: Mapping[str, float]


def draw(folders: Sequence[Path], out: Path, baselines: Sequence[str], bounds: Path) -> list[Path]:
    """Plot learning curves, one picture per environment: a thin line per run, and levels of reference policies.

    Args:
        folders: of the runs, of any algorithms, environments and seeds.
        out: folder of the pictures, learning_ENVIRONMENT.png; made if it does not exist.
        baselines: names of classical policies, flown on the same validation seeds.
        bounds: folder of the cached bounds of these seeds.

    Returns:
        Paths of the pictures.

    Raises:
        ConfigError: no run, no curve, an unknown policy, or two runs of one environment that cannot be compared.
        OSError: a picture cannot be written.
    """
    pictures = []
    for name, runs in by_environment(folders).items():
        figure = figure_of(runs, levels_of(runs[0].run, baselines, bounds))
        out.mkdir(parents=True, exist_ok=True)
        pictures.append(out / f"learning_{name}.png")
        with replacing(pictures[-1]) as temporary:
            figure.savefig(temporary, dpi=150, metadata={"Software": None})
    return pictures


def by_environment(folders: Sequence[Path]) -> dict[str, list[TrainingCurve]]:
    """Group runs by environment.

    Raises:
        ConfigError: two of a group were not validated on the same episodes.
    """
    groups: dict[str, list[TrainingCurve]] = {}
    for folder in folders:
        item = TrainingCurve(folder, load_run(folder), read_pretraining(folder), read_curve(folder))
        first = groups.setdefault(item.name, [item])[0]
        for key in ("scenario", "validation_episodes"):
            if getattr(item.run, key) != getattr(first.run, key):
                raise ConfigError(f"{folder}: {key}: differs from that of {first.folder}; plot it separately")
        if item is not first:
            groups[item.name].append(item)
    return groups


def levels_of(run: Run, baselines: Sequence[str], bounds: Path) -> Levels:
    """Reference costs on a run's validation seeds."""
    classical = {
        name: -validate(make_policy(name, run.scenario), run.scenario, run.validation_episodes)["return"]
        for name in baselines
    }
    least = least_costs(run.scenario, seeds("validation", run.validation_episodes), bounds)
    return Levels(None if least is None else float(least.mean()), classical)


def figure_of(runs: Sequence[TrainingCurve], levels: Levels) -> Figure:
    """Figure with pretraining on the left, if any run has its log, and reinforcement learning on the right."""
    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    known = [item.pretraining for item in runs if item.pretraining is not None]
    parts: list[Axes] = list(figure.subplots(1, 2 if known else 1, sharey=True, squeeze=False)[0])
    floor = levels.bound or 0.0
    for log in known:
        _plot(parts[0], log, floor, PRETRAINING)
    for algorithm in (name for name in ALGORITHMS if any(item.run.algorithm == name for item in runs)):
        _plot_runs(parts[-1], [item for item in runs if item.run.algorithm == algorithm], floor)
    for name, look in looks(levels.classical).items():
        for axes in parts:
            level = levels.classical[name]
            label = f"{name}, {level:.4g} m/s" if axes is parts[-1] else None
            axes.axhline(level - floor, color=look.color, linestyle=DASHES[look.dash], linewidth=1.2, label=label)
    _describe(figure, parts, runs[0].run, levels)
    return figure


def _plot_runs(axes: Axes, runs: Sequence[TrainingCurve], floor: float) -> None:
    """Plot the runs of one algorithm; the first has the legend entry."""
    algorithm, steps = runs[0].run.algorithm, runs[0].run.steps
    best = min(-item.curve["return"].max() for item in runs)
    lines = [_plot(axes, item.curve, floor, looks(ALGORITHMS)[algorithm].color) for item in runs]
    lines[0].set_label(f"{algorithm}, {len(runs)} × {steps:,} steps, best {best:.4g} m/s")


def _plot(axes: Axes, table: pd.DataFrame, floor: float, color: str) -> Line2D:
    """Plot cost above the floor, m/s, over minutes."""
    (line,) = axes.plot(table["seconds"] / 60, -table["return"] - floor, color=color, linewidth=0.9)
    line.set(marker=".", markersize=3)
    return line


def _describe(figure: Figure, parts: Sequence[Axes], run: Run, levels: Levels) -> None:
    """Label the axes, and place the legend below them."""
    for axes, what in zip(parts[::-1], ("reinforcement learning", "pretraining"), strict=False):
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1,)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}" if high < 5 * low else NullFormatter())
        axes.grid(which="both", alpha=0.25)
        axes.set_xlabel(f"wall time of {what}, min")
    above = "" if levels.bound is None else f" above the bound of {levels.bound:.4g} m/s"
    parts[0].set_ylabel(f"mean cost{above}, m/s")
    figure.suptitle(f"{run.env}: {run.validation_episodes} validation episodes")
    figure.legend(*parts[-1].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
