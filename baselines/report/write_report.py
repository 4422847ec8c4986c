"""From policies to files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from baselines.experiments.comparison import Environment, name_environments
from baselines.experiments.effort import Wanted
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.run_comparison import fly
from baselines.experiments.statistics import analyse, episode_table, summary_table
from baselines.report.json_document import document, to_json
from baselines.report.page import render
from baselines.report.table import Tables, no_tables
from formation_env.files import write_texts

FILES: Final = ("episodes.csv", "summary.csv", "sweep.csv", "report.json", "report.html")


def write_report(
    policies: Mapping[str, PolicyFactory],
    envs: Sequence[Environment],
    wanted: Wanted,
    out: Path,
    command: str,
    workers: int = 1,
    tables: Tables = no_tables,
) -> Path:
    """Fly policies on environments with the same test seeds, and write the report's files.

    Args:
        policies: label -> factory; with more than one process they must be importable, so no lambdas.
        envs: registered ids, names or paths of scenarios, or Scenarios.
        wanted: how much to fly.
        out: folder of `FILES`, of the bounds that were found and of the flights to resume from; made if there is none.
        command: the command line that redoes the report; noted in it.
        workers: processes to fly in; with 1 all is flown in this one.
        tables: makes further tables of the results; they stand on the page, and as NAME.md beside it.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty environment or policy, or an environment without any.
        ValueError: no or too many episodes.
        RuntimeError: the bound's solver failed.
        OSError: the folder cannot be written; nothing in it has changed then, but for bounds and kept flights.
    """
    scenarios = name_environments(envs)
    found = fly(policies, scenarios, wanted, out, workers)
    results = analyse(found.flown, found.bounds)
    further = tables(results)
    data = document(results, found.sweep, wanted, command, further)
    contents = (
        episode_table(results).to_csv(index=False),
        summary_table(results).to_csv(index=False),
        found.sweep.episodes.to_csv(index=False),
        to_json(data),
        render(results, found.sweep, data),
    )
    beside = {f"{table.name}.md": table.markdown() for table in further}
    write_texts(out, beside | dict(zip(FILES, contents, strict=True)))
    return out / FILES[-1]
