"""From policies to files."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from baselines.report.bounds import find_bounds
from baselines.report.document import document, to_json
from baselines.report.flights import Environment, PolicyFactory, fly
from baselines.report.page import render
from baselines.report.results import analyse, episode_table, summary_table
from formation_env.files import write_texts
from formation_env.seeds import seeds as seeds_of

FILES = ("episodes.csv", "summary.csv", "report.json", "report.html")


def write_report(
    policies: Mapping[str, PolicyFactory], envs: Sequence[Environment], episodes: int, out: Path, command: str
) -> Path:
    """Fly policies on environments with the same test seeds, and write the report's files.

    Args:
        policies: label -> factory that makes the policy for a scenario (or gives None if it has none for it).
        envs: registered ids, names or paths of scenarios, or Scenarios.
        episodes: seeds per environment.
        out: folder of `FILES` and of the bounds that were found; made if it does not exist.
        command: the command line that redoes the report; noted in it.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty environment or policy.
        ValueError: no or too many episodes.
        OSError: the folder cannot be written; nothing in it has changed then.
    """
    seeds = seeds_of("test", episodes)
    flown = fly(policies, envs, seeds)
    results = analyse(flown, find_bounds(flown, seeds, out))
    data = document(results, seeds, command)
    contents = (
        episode_table(results).to_csv(index=False),
        summary_table(results).to_csv(index=False),
        to_json(data),
        render(results, data),
    )
    write_texts(out, dict(zip(FILES, contents, strict=True)))
    return out / "report.html"
