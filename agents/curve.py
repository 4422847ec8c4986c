"""The picture of a learning curve."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from agents.runs import Run, load_run, read_curve
from agents.validation import validate
from baselines import make_policy
from formation_env.files import replacing
from formation_env.settings import ConfigError

COLORS: Final = {"zero": "#868b94", "lqr": "#0072B2", "lqr_tracking": "#56B4E9", "smc": "#D55E00"}
LEARNED: Final = "#009E73"
"""Okabe and Ito's colours, told apart by colour-blind readers; the same as the report's."""


def draw(folder: Path, out: Path, baselines: Sequence[str]) -> None:
    """Draw a run's curve, and the levels of classical policies on the same validation seeds.

    Args:
        folder: the run's.
        out: picture to write; its ending says the format.
        baselines: names of classical policies.

    Raises:
        ConfigError: no run, no curve, an unknown policy, or an unknown ending.
        OSError: the picture cannot be written.
    """
    run, curve = load_run(folder), read_curve(folder)
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    if out.suffix.lstrip(".") not in figure.canvas.get_supported_filetypes():
        raise ConfigError(f"{out}: must end in .png, .svg or .pdf")
    axes = figure.add_subplot()
    _plot_curve(axes, curve, run)
    for name in baselines:
        level = validate(make_policy(name, run.scenario), run.scenario, run.validation_episodes)["return"]
        axes.axhline(-level, color=COLORS.get(name, "black"), linestyle="--", label=f"{name} ({level:.2f} m/s)")
    _label(axes, curve, run)
    out.parent.mkdir(parents=True, exist_ok=True)
    with replacing(out) as temporary:
        figure.savefig(temporary, dpi=150)


def _plot_curve(axes: Axes, curve: pd.DataFrame, run: Run) -> None:
    steps = curve["steps"] / 1e6
    best = curve["return"].max()
    axes.fill_between(steps, -curve["return_high"], -curve["return_low"], color=LEARNED, alpha=0.25, linewidth=0)
    axes.plot(steps, -curve["return"], color=LEARNED, marker=".", label=f"{run.algorithm}, best {best:.2f} m/s")


def _label(axes: Axes, curve: pd.DataFrame, run: Run) -> None:
    minutes = curve["seconds"].iloc[-1] / 60
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel(f"environment steps, millions (the whole run took {minutes:.1f} min)")
    axes.set_ylabel("minus the return: equivalent delta-v, m/s")
    axes.set_title(f"{run.env}: mean of {run.validation_episodes} validation episodes, 95 % interval")
    axes.grid(which="both", alpha=0.25)
    axes.legend()
