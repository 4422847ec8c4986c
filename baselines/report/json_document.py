"""The report as data: `report.json`."""

import json
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from typing import Any

import numpy as np

import formation_env
from baselines.experiments.effort import ReportOptions
from baselines.experiments.estimates import MIN_VERDICT_EPISODES, Interval
from baselines.experiments.statistics import Results
from baselines.experiments.sweep import Sweep
from baselines.report.table import Table
from formation_env.evaluation.seeds import seeds

LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "gymnasium",
    "pandas",
    "control",
    "clarabel",
    "plotly",
    "stable-baselines3",
    "torch",
)
"""Libraries whose versions are recorded, where they are installed."""


def versions() -> dict[str, str]:
    """Versions of the interpreter, of this project and of the libraries behind the numbers."""
    found = {"python": platform.python_version(), "formation_env": formation_env.__version__}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found


def document(
    results: list[Results], sweep: Sweep, options: ReportOptions, command: str, tables: Sequence[Table]
) -> dict[str, Any]:
    """The report as plain data: all that is needed to repeat it and to check its numbers."""
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "versions": versions(),
        "seeds": list(seeds("test", options.episodes)),
        "options": asdict(options),
        "means": "over all seeds; where estimated, the reference's mean plus the paired difference to it",
        "verdicts": f"significant: null below {MIN_VERDICT_EPISODES} common episodes",
        "intervals": "bootstrap, 95 %, of the mean",
        "environments": {item.flown.label: _environment(item) for item in results},
        "tables": [table.as_data() for table in tables],
        "sweep": sweep.as_data(),
    }


def _environment(results: Results) -> dict[str, Any]:
    flown = results.flown
    return {
        "scenario": asdict(flown.scenario),
        "num_steps": flown.scenario.num_steps,
        "flight_seed": flown.flight_seed,
        "ranking": results.ranking,
        "best": results.best,
        "reference": results.reference,
        "bounds": results.bounds,
        "policies": {name: _policy(results, name) for name in flown.episodes},
    }


def _policy(results: Results, name: str) -> dict[str, Any]:
    summary = results.summaries[name]
    return {
        "settings": results.flown.settings.get(name),
        "episodes": results.count(name),
        "estimated": name in results.partial,
        "ended_early": results.ended_early(name),
        "action_time_us": results.flown.action_time_us(name),
        "cost_m_s": _interval(results.cost(name)),
        "cost_on_seeds_flown_m_s": _interval(results.cost_flown(name)),
        "cost_ratio": _interval(results.cost_ratios.get(name)),
        "cost_ratio_on_seeds_flown": _interval(results.cost_ratios_flown.get(name)),
        "summary": {str(metric): _interval(results.interval(name, str(metric))) for metric in summary.index},
        "paired_differences": {
            reference: {metric: _interval(values) for metric, values in differences[name].items()}
            | {"n": results.common(name, reference), "significant": results.verdict(name, reference)}
            for reference, differences in results.differences.items()
            if name != reference
        },
    }


def _interval(interval: Interval | None) -> dict[str, float] | None:
    return None if interval is None else dict(zip(("mean", "low", "high"), interval, strict=True))


def to_json(data: dict[str, Any]) -> str:
    """Strict JSON: NaN and infinities become null, arrays become lists."""
    return json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int, bool, type(None))) else str(value)
