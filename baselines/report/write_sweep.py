"""From a sweep's flights to its files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from baselines.experiments import parallel
from baselines.experiments.comparison import Environment, name_environments
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.result_cache import FOLDER, keep
from baselines.experiments.sweep import Sweep, points
from baselines.optimal.cone_solver import SOLVER
from baselines.report.json_document import to_json, versions
from baselines.report.sweep_page import render
from formation_env.evaluation.seeds import seeds as seeds_of
from formation_env.files import write_texts
from formation_env.task.scenario import Scenario

FILES: Final = ("sweep.csv", "sweep.json", "sweep.html")


@dataclass(frozen=True)
class Wanted:
    """What to sweep.

    Attributes:
        episodes: test seeds of each point.
        bound_episodes: seeds, among them, that the bound's front is solved on.
        resume: whether finished flights are kept, and those that were kept are not flown again.
    """

    episodes: int = 20
    bound_episodes: int = 5
    resume: bool = False


def write_sweep(
    policies: Mapping[str, PolicyFactory],
    envs: Sequence[Environment],
    wanted: Wanted,
    out: Path,
    command: str,
    workers: int,
) -> Path:
    """Fly the sweep, and write `FILES`; they appear only when all are complete.

    Args:
        policies: label -> factory.
        envs: registered ids, names or paths of scenarios, or Scenarios.
        wanted: what to sweep.
        out: folder to write to; made if it does not exist.
        command: the command line that redoes it; noted in the files.
        workers: processes to fly in.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty environment, or a variation that does not fit an environment.
        RuntimeError: the bound's solver failed.
        ModuleNotFoundError: Clarabel is not installed, and the bound is wanted.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    scenarios, seeds = name_environments(envs), seeds_of("test", wanted.episodes)
    work = points(scenarios, policies, seeds, wanted.bound_episodes)
    if any(job.bound_seeds for job in work.values()):
        import_module(SOLVER)  # that it is missing should be known before the flights, not after
    found = parallel.fly(keep(work, out / FOLDER if wanted.resume else None), workers)
    sweep = Sweep.join([found[name] for name in work], {})
    data = document(scenarios, sweep, seeds, wanted, command)
    contents = (sweep.episodes.to_csv(index=False), to_json(data), render(scenarios, sweep, data))
    write_texts(out, dict(zip(FILES, contents, strict=True)))
    return out / FILES[-1]


def document(
    scenarios: dict[str, Scenario], sweep: Sweep, seeds: Sequence[int], wanted: Wanted, command: str
) -> dict[str, Any]:
    """All that is needed to redo and to judge the sweep, as plain data."""
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "versions": versions(),
        "seeds": list(seeds),
        "bound_seeds": list(seeds)[: wanted.bound_episodes],
        "intervals": "bootstrap, 95 %, of the mean",
        "environments": {label: asdict(scenario) for label, scenario in scenarios.items()},
    } | sweep.as_data()
