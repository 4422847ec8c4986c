"""From policies to the report's files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from baselines.experiments.comparison import Environment, name_environments
from baselines.experiments.effort import ReportOptions
from baselines.experiments.policy_factories import PolicyFactory
from baselines.experiments.run_comparison import run_comparison
from baselines.experiments.statistics import analyse, episode_table, summary_table
from baselines.report.csv_text import csv_text
from baselines.report.json_document import document, to_json
from baselines.report.page import render
from baselines.report.results_page import results_page
from baselines.report.table import Tables, no_tables
from baselines.result_cache import remove_temporaries
from formation_env.files import check_writable, write_texts

FILES: Final = ("episodes.csv", "summary.csv", "sweep.csv", "report.json", "results.md", "report.html")


def write_report(
    policies: Mapping[str, PolicyFactory],
    envs: Sequence[Environment],
    options: ReportOptions,
    out: Path,
    command: str,
    workers: int = 1,
    tables: Tables = no_tables,
) -> Path:
    """Fly policies on environments with the same test seeds, and write the report's files.

    Args:
        policies: label -> factory; with more than one process they must be importable, so no lambdas.
        envs: registered ids, names or paths of scenarios, or Scenarios.
        options: effort.
        out: folder of `FILES`, of the cached bounds and of the finished jobs; made if there is none.
        command: the command line that repeats the report; recorded in it.
        workers: processes; with 1 all episodes are flown in this one.
        tables: makes further tables of the results; they stand on the page, and as NAME.md beside it.

    Returns:
        Path of the HTML page.

    Raises:
        ConfigError: a faulty environment or policy, or an environment without any.
        ValueError: no or too many episodes.
        RuntimeError: the bound's solver failed, or a worker process died.
        OSError: the folder cannot be written, which is found before the first episode; nothing in it has changed then,
            but for cached bounds and finished jobs.
    """
    scenarios = name_environments(envs)
    check_writable(out)
    remove_temporaries(out, lambda name: name.startswith(tuple(f".{Path(file).stem}." for file in FILES)))
    flown = run_comparison(policies, scenarios, options, out, workers)
    results = analyse(flown.flown, flown.bounds)
    further = tables(results)
    data = document(results, flown.sweep, options, command, further)
    contents = (
        csv_text(episode_table(results)),
        csv_text(summary_table(results)),
        csv_text(flown.sweep.episodes),
        to_json(data),
        results_page(results, command),
        render(results, flown.sweep, data, further),
    )
    beside = {f"{table.name}.md": table.markdown() for table in further}
    write_texts(out, beside | dict(zip(FILES, contents, strict=True)))
    return out / FILES[-1]
