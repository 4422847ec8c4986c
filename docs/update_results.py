"""Copy the tables that `make report` wrote into the documentation: docs/results.md, and the table of the README.

Run by `make results`. Nothing else writes numbers into these two places; a test holds them equal.
"""

import argparse
import re
from pathlib import Path

from formation_env.files import write_texts

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"(<!-- results:begin -->\n).*?(<!-- results:end -->)", re.DOTALL)
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def pages(report: Path, readme: str) -> tuple[str, str]:
    """Texts of docs/results.md and of the README.

    Args:
        report: folder of a report.
        readme: the README as it is.
    """
    results, learned = (report / name for name in ("results.md", "learned.md"))
    page = f"{results.read_text(encoding='utf-8')}\n## Learned policies\n\n{learned.read_text(encoding='utf-8')}"
    first = TABLE.search(page)
    assert first is not None, f"{results} has a table"
    return page, BLOCK.sub(lambda found: found[1] + first[0] + found[2], readme)


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path, help="folder that `make report` wrote")
    page, readme = pages(parser.parse_args().report, (ROOT / "README.md").read_text(encoding="utf-8"))
    write_texts(ROOT / "docs", {"results.md": page})
    write_texts(ROOT, {"README.md": readme})


if __name__ == "__main__":
    main()
