"""From a sweep to its files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from baselines.experiments import parallel
from baselines.experiments.cached_jobs import FOLDER, cached
from baselines.experiments.comparison import Environment, name_environments
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.sweep import Sweep, points
from baselines.optimal.cone_solver import SOLVER
from baselines.report.csv_text import csv_text
from baselines.report.json_document import to_json, versions
from baselines.report.sweep_page import render
from baselines.result_cache import remove_temporaries
from formation_env.evaluation.seeds import seeds as seeds_of
from formation_env.files import check_writable, write_texts
from formation_env.task.scenario import Scenario

FILES: Final = ("sweep.csv", "sweep.json", "sweep.html")


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """Effort of a sweep.

    Attributes:
        episodes: test seeds of each point.
        bound_episodes: seeds, among them, for which the trade-off bound is solved.
        resume: whether finished jobs are cached, and cached ones are not run again.
    """

    episodes: int = 20
    bound_episodes: int = 5
    resume: bool = False


def write_sweep(
    policies: Mapping[str, PolicyFactory],
    envs: Sequence[Environment],
    options: SweepOptions,
    out: Path,
    command: str,
    workers: int,
) -> Path:
    """Fly the sweep, and write `FILES`; they appear only when all are complete.

    Args:
        policies: label -> factory.
        envs: registered ids, names or paths of scenarios, or Scenarios.
        options: effort.
        out: folder to write to; made if it does not exist.
        command: the command line that repeats it; recorded in the files.
        workers: processes.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty environment, or a variation that does not fit an environment.
        RuntimeError: the bound's solver failed, or a worker process died.
        ModuleNotFoundError: Clarabel is not installed, and the bound is asked for.
        OSError: the folder cannot be written, which is found before the first episode.
    """
    scenarios, seeds = name_environments(envs), seeds_of("test", options.episodes)
    jobs = points(scenarios, policies, seeds, options.bound_episodes)
    if any(job.bound_seeds for job in jobs.values()):
        import_module(SOLVER)  # a missing solver is reported before the episodes, not after
    check_writable(out)
    remove_temporaries(out, lambda name: name.startswith(".sweep."))
    tables = parallel.run_with_bar(cached(jobs, out / FOLDER if options.resume else None), workers, "sweep")
    sweep = Sweep.join([tables[name] for name in jobs], {})
    data = document(scenarios, sweep, seeds, options, command)
    contents = (csv_text(sweep.episodes), to_json(data), render(scenarios, sweep, data))
    write_texts(out, dict(zip(FILES, contents, strict=True)))
    return out / FILES[-1]


def document(
    scenarios: dict[str, Scenario], sweep: Sweep, seeds: Sequence[int], options: SweepOptions, command: str
) -> dict[str, Any]:
    """The sweep as plain data: all that is needed to repeat it and to check its numbers."""
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "versions": versions(),
        "seeds": list(seeds),
        "bound_seeds": list(seeds)[: options.bound_episodes],
        "intervals": "bootstrap, 95 %, of the mean",
        "environments": {label: asdict(scenario) for label, scenario in scenarios.items()},
    } | sweep.as_data()
