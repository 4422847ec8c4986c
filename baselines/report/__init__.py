"""The evaluation report: policies flown on the same seeds, as tables and one self-contained HTML page.

`write_report` takes any policies by name, so learned policies stand beside the classical ones.
"""

from baselines.experiments.effort import ReportOptions
from baselines.report.results_page import results_page
from baselines.report.table import Quantity, Table
from baselines.report.write_report import FILES, write_report

__all__ = ["FILES", "Quantity", "ReportOptions", "Table", "results_page", "write_report"]
