"""The sweep's HTML page: one file that needs no network."""

from collections.abc import Mapping
from typing import Any

from baselines.experiments.sweep import Sweep
from baselines.report import html
from baselines.report.sweep_figures import looks_of
from baselines.report.sweep_section import section
from formation_env.task.scenario import Scenario


def render(scenarios: Mapping[str, Scenario], sweep: Sweep, data: dict[str, Any]) -> str:
    """The page of all environments.

    Args:
        scenarios: by label.
        sweep: what was flown.
        data: the sweep as data (`report.document`).
    """
    looks = looks_of(sweep.summary["policy"].unique())
    sections = [
        {
            "anchor": f"env-{index}",
            "label": label,
            "title": scenario.title,
            "sweep": section(index, scenario, sweep.of(label), looks),
        }
        for index, (label, scenario) in enumerate(scenarios.items())
    ]
    return html.render("sweep.html.jinja", {"data": data, "sections": sections})
