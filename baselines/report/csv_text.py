"""Tables as CSV text that a spreadsheet does not run."""

import pandas as pd

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a text that begins so for a formula."""


def csv_text(table: pd.DataFrame) -> str:
    """A table as CSV; texts that a spreadsheet would take for formulas get an apostrophe in front."""
    texts = {name: values.map(_neutral) for name, values in table.items() if not pd.api.types.is_numeric_dtype(values)}
    return table.assign(**{str(name): values for name, values in texts.items()}).to_csv(index=False)


def _neutral(cell: object) -> object:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA_STARTS) else cell
