"""What the pages share: the template engine, the style sheet and figures as HTML."""

from typing import Any

import jinja2
import plotly.io
from markupsafe import Markup
from plotly.graph_objects import Figure
from plotly.offline import get_plotlyjs

_LOADER = jinja2.PackageLoader("baselines.report")


def render(template: str, content: dict[str, Any]) -> str:
    """A page: one file that needs no network; plotly.js stands once in its head.

    Args:
        template: name of its file.
        content: what the template shows.
    """
    environment = jinja2.Environment(
        loader=_LOADER, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(template).render({"plotly_js": Markup(get_plotlyjs())} | content)


def div(figure: Figure, name: str) -> Markup:
    """A figure as an HTML element with its data."""
    config = {"responsive": True, "displaylogo": False, "modeBarButtonsToRemove": ["select2d", "lasso2d"]}
    html = plotly.io.to_html(figure, full_html=False, include_plotlyjs=False, div_id=name, config=config)
    return Markup(html)
