"""Shared style of the thesis's figures: sizes, colours, axes and file formats."""

from io import BytesIO
from typing import Any, Final

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from baselines.report.style import NEUTRAL, looks

WIDTH_IN: Final = 8.0
DPI: Final = 150
AXES: Final = (("x", "#009E73", "-"), ("y", "#E69F00", "--"), ("z", "#333333", "-."))
"""Name, colour and dash of each LVLH axis; Okabe and Ito's colours."""
COLORS: Final = {name: look.color for name, look in looks(("lqr", "lqr_quasi_static", "smc")).items()}
"""Colours of the policies, as in the report."""
DESIRED: Final = NEUTRAL
PLANNED: Final = "#333333"
START: Final = "#E69F00"
_SETTINGS: Final[Any] = {
    "svg.hashsalt": "formation-env",  # equal figures are equal files
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.35,
    "axes.axisbelow": True,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "axes.formatter.useoffset": False,
}
_NO_DATE: Final = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}


def settings() -> Any:
    """Context in which figures are drawn and saved."""
    return matplotlib.rc_context(_SETTINGS)


def sheet(height_in: float) -> Figure:
    """Make an empty figure with constrained layout."""
    return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def label(axes: Axes, x: str, y: str) -> None:
    """Label quantity and unit of both axes."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def legend(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """Put one legend above all axes, where it hides no data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(columns, len(labels)))


def images(figure: Figure) -> dict[str, bytes]:
    """Files of the figure by kind, `svg` and `png`; it is laid out once, since the layout is slow."""
    result = {}
    for kind, metadata in _NO_DATE.items():
        stream = BytesIO()
        figure.savefig(stream, format=kind, dpi=DPI, metadata=metadata)
        figure.set_layout_engine("none")
        result[kind] = stream.getvalue()
    return result


def few_ticks() -> MaxNLocator:
    """Tick locator of small axes."""
    return MaxNLocator(4, min_n_ticks=3)
