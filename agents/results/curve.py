"""Pictures of learning curves: what runs cost on the validation seeds, against the time that they took."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from agents.hyperparameters import ALGORITHMS
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
"""The report's dashes, as matplotlib calls them."""
PRETRAINING: Final = "#333333"
"""Colour of what all algorithms have in common."""


@dataclass(frozen=True)
class Learnt:
    """A run, and how it went.

    Attributes:
        folder: of the run.
        run: its settings.
        pretraining: its judgements, if they are known.
        curve: its validations.
    """

    folder: Path
    run: Run
    pretraining: pd.DataFrame | None
    curve: pd.DataFrame

    @property
    def name(self) -> str:
        """Of what was flown: the scenario's."""
        return scenario_name(self.run.env)


@dataclass(frozen=True)
class Levels:
    """What others cost on the same validation seeds.

    Attributes:
        bound: the mean of the least costs, m/s; None where it is not known.
        classical: mean cost of classical policies by name, m/s.
    """

    bound: float | None
    classical: Mapping[str, float]


def draw(folders: Sequence[Path], out: Path, baselines: Sequence[str], bounds: Path) -> list[Path]:
    """Draw the curves of runs, one picture for each environment: a thin line for each run, levels of the others.

    Args:
        folders: of the runs, of any algorithms, environments and seeds.
        out: folder of the pictures, learning_ENVIRONMENT.png; made if it does not exist.
        baselines: names of classical policies, flown on the same validation seeds.
        bounds: folder that keeps the bounds of these seeds.

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


def by_environment(folders: Sequence[Path]) -> dict[str, list[Learnt]]:
    """The runs of each environment.

    Raises:
        ConfigError: two of them were not validated on the same episodes.
    """
    found: dict[str, list[Learnt]] = {}
    for folder in folders:
        learnt = Learnt(folder, load_run(folder), read_pretraining(folder), read_curve(folder))
        first = found.setdefault(learnt.name, [learnt])[0]
        for key in ("scenario", "validation_episodes"):
            if getattr(learnt.run, key) != getattr(first.run, key):
                raise ConfigError(f"{folder}: {key}: is another than that of {first.folder}; draw it apart")
        if learnt is not first:
            found[learnt.name].append(learnt)
    return found


def levels_of(run: Run, baselines: Sequence[str], bounds: Path) -> Levels:
    """The levels on a run's validation seeds."""
    classical = {
        name: -validate(make_policy(name, run.scenario), run.scenario, run.validation_episodes)["return"]
        for name in baselines
    }
    least = least_costs(run.scenario, seeds("validation", run.validation_episodes), bounds)
    return Levels(None if least is None else float(least.mean()), classical)


def figure_of(runs: Sequence[Learnt], levels: Levels) -> Figure:
    """Pretraining on the left, if any run knows of it, and what came then on the right."""
    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    known = [learnt.pretraining for learnt in runs if learnt.pretraining is not None]
    parts: list[Axes] = list(figure.subplots(1, 2 if known else 1, sharey=True, squeeze=False)[0])
    floor = levels.bound or 0.0
    for judgements in known:
        _plot(parts[0], judgements, floor, PRETRAINING)
    for algorithm in (name for name in ALGORITHMS if any(learnt.run.algorithm == name for learnt in runs)):
        _plot_runs(parts[-1], [learnt for learnt in runs if learnt.run.algorithm == algorithm], floor)
    for name, look in looks(levels.classical).items():
        for axes in parts:
            level = levels.classical[name]
            label = f"{name}, {level:.4g} m/s" if axes is parts[-1] else None
            axes.axhline(level - floor, color=look.color, linestyle=DASHES[look.dash], linewidth=1.2, label=label)
    _describe(figure, parts, runs[0].run, levels)
    return figure


def _plot_runs(axes: Axes, runs: Sequence[Learnt], floor: float) -> None:
    """The lines of one algorithm's runs; the first stands in the legend for all."""
    algorithm, steps = runs[0].run.algorithm, runs[0].run.steps
    best = min(-learnt.curve["return"].max() for learnt in runs)
    lines = [_plot(axes, learnt.curve, floor, looks(ALGORITHMS)[algorithm].color) for learnt in runs]
    lines[0].set_label(f"{algorithm}, {len(runs)} × {steps:,} steps, best {best:.4g} m/s")


def _plot(axes: Axes, table: pd.DataFrame, floor: float, color: str) -> Line2D:
    """Cost above the floor, m/s, over minutes."""
    (line,) = axes.plot(table["seconds"] / 60, -table["return"] - floor, color=color, linewidth=0.9)
    line.set(marker=".", markersize=3)
    return line


def _describe(figure: Figure, parts: Sequence[Axes], run: Run, levels: Levels) -> None:
    """Quantities and units, and a legend below, where it hides nothing."""
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
