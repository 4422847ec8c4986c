"""The evaluation report: policies flown on the same seeds, as tables and one self-contained HTML page.

`write_report` takes any policies by name, so learned ones stand beside the classical ones.
"""

from baselines.experiments.effort import Wanted
from baselines.report.table import Table
from baselines.report.write_report import FILES, write_report

__all__ = ["FILES", "Table", "Wanted", "write_report"]
