"""Command line: `formation-env`, or `python -m formation_env`."""

import sys

from formation_env.cli_errors import one_line_errors


def main() -> None:
    """Run `formation-env`; imports happen inside, so that an interrupt during them is one line, too."""
    with one_line_errors():
        from formation_env.cli import app

        app(prog_name="formation-env")


def main_of_env() -> None:
    """Run `python -m formation_env`, which takes the commands of the group `env` directly."""
    with one_line_errors():
        from formation_env.cli import app, with_group

        app(with_group(sys.argv[1:]), prog_name="formation-env")


if __name__ == "__main__":
    main_of_env()
