"""Command line: `python -m baselines`, the same as `formation-env baselines`."""

from formation_env.cli_errors import one_line_errors


def main() -> None:
    """Run the commands; imports happen inside, so that an interrupt during them is one line, too."""
    with one_line_errors():
        from baselines.cli import app

        app(prog_name="formation-env baselines")


if __name__ == "__main__":
    main()
