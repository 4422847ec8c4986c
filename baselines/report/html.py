"""Parts that all pages share: the template engine, the style sheet and figures as HTML."""

from typing import Any

import jinja2
from markupsafe import Markup
from plotly.graph_objects import Figure
from plotly.offline import get_plotlyjs

_LOADER = jinja2.PackageLoader("baselines.report")
_CONFIG = '{"responsive": true, "displaylogo": false, "modeBarButtonsToRemove": ["select2d", "lasso2d"]}'


def render(template: str, content: dict[str, Any]) -> str:
    """A page: one file that needs no network; plotly.js stands once in its head.

    Args:
        template: name of its file.
        content: variables of the template.
    """
    environment = jinja2.Environment(
        loader=_LOADER, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    shared = {"plotly_js": Markup(get_plotlyjs()), "plotly_config": Markup(_CONFIG)}
    return environment.get_template(template).render(shared | content)


def div(figure: Figure, name: str) -> Markup:
    """A figure as an HTML element with its data; `figures.js` draws it when it is scrolled into view.

    Args:
        figure: of plotly, with a height.
        name: id of the element.
    """
    height = int(figure.layout.height)
    data = figure.to_json().replace("<", "\\u003c")  # nothing in it may end the script element
    return Markup(
        f'<div class="plot" id="{name}" style="min-height: {height}px">'
        f'<script type="application/json">{data}</script></div>'
    )
