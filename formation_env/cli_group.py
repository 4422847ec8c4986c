"""The command groups: one grammar, renamed names that say what they are called now, and commands from entry points."""

import importlib.metadata
import importlib.util
import inspect
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, TypeVar, get_type_hints

import typer
from typer.core import TyperGroup

from formation_env.cli_errors import DISTRIBUTION, WRONG_INPUT, one_line_errors

T = TypeVar("T")
ENTRY_POINTS: Final = "formation_env.commands"
"""Entry points of other packages: the name of a group, and its Typer app."""
UsageError: Final[type[Exception]] = typer.BadParameter.__bases__[0]
"""Click's error for wrong options; old Typers import Click, new ones carry their own."""


class Group(TyperGroup):
    """A group whose commands end in one line after an error, and whose former names give the new ones.

    Attributes:
        renamed: former command -> the command line that replaces it.
        renamed_options: command -> its former options -> their replacement.
    """

    renamed: ClassVar[Mapping[str, str]] = {}
    renamed_options: ClassVar[Mapping[str, Mapping[str, str]]] = {}

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an error of the user or the machine is one line."""
        with one_line_errors():
            try:
                return super().invoke(ctx)
            except UsageError as error:
                if type(error).__name__ == "NoArgsIsHelpError":  # it shows the help
                    raise
                where = getattr(getattr(error, "ctx", None), "command_path", DISTRIBUTION)
                message = error.format_message().rstrip(".")  # type: ignore[attr-defined]
                print(f"error: {message}; see {where} --help", file=sys.stderr)
                raise SystemExit(WRONG_INPUT) from None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command, and refuse what has a new name.

        Raises:
            ConfigError: a former command or option; the message names its replacement.
        """
        from formation_env.settings import ConfigError

        command, *rest = args
        if command in self.renamed and command not in self.commands:
            raise ConfigError(f"{command}: now {self.renamed[command]}")
        for option in (argument.partition("=")[0] for argument in rest):
            if option in (former := self.renamed_options.get(command, {})):
                raise ConfigError(f"{command} {option}: now {former[option]}")
        return super().resolve_command(ctx, args)


class RootGroup(Group):
    """The program itself: its own groups, and those that other packages offer as entry points."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Own groups first; a group whose package is not ours is left out, and named when it is asked for."""
        offered = {name: point for name, point in _offered().items() if _is_ours(_package(point))}
        return [*super().list_commands(ctx), *(name for name in offered if name not in self.commands)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A group by name; an entry point's module is imported here.

        Raises:
            ConfigError: another distribution has taken the package's name.
        """
        own = super().get_command(ctx, cmd_name)
        if own is not None or cmd_name not in (offered := _offered()):
            return own
        check_owner(_package(offered[cmd_name]))
        group = typer.main.get_group(offered[cmd_name].load())
        group.name = cmd_name
        return group


def _offered() -> dict[str, importlib.metadata.EntryPoint]:
    """The entry points of other packages by name: baselines before agents."""
    found = importlib.metadata.entry_points(group=ENTRY_POINTS)
    return {point.name: point for point in sorted(found, key=lambda point: point.name, reverse=True)}


def _package(point: importlib.metadata.EntryPoint) -> str:
    """Top-level package of an entry point."""
    return point.module.partition(".")[0]


def check_owner(package: str) -> None:
    """Refuse a package of this distribution whose name another distribution has taken.

    PyPI's `openai-agents` and `baselines` install folders `agents` and `baselines`: they overwrite `__init__.py`, and
    pip does not warn.

    Args:
        package: name of the top-level package.

    Raises:
        ConfigError: the package is missing, stands elsewhere, or its `__init__.py` is not ours.
    """
    from formation_env.settings import ConfigError

    if _is_ours(package):
        return
    ours = Path(__file__).parents[1] / package / "__init__.py"
    if ours.parent.is_dir() and not ours.exists():
        raise ConfigError(f"{ours}: missing, perhaps removed with another package; install {DISTRIBUTION} again")
    claims = importlib.metadata.packages_distributions().get(package, [])
    others = sorted({name for name in claims if name != DISTRIBUTION}) or ["another package"]
    raise ConfigError(
        f"the name {package!r} is taken by {', '.join(others)}; install {DISTRIBUTION} in an environment of its own"
    )


def _is_ours(package: str) -> bool:
    """Whether Python would import our package: it lies beside this one, and its `__init__.py`, read, says so."""
    spec = importlib.util.find_spec(package)
    ours = Path(__file__).resolve().parents[1] / package / "__init__.py"
    if spec is None or spec.origin is None or Path(spec.origin).resolve() != ours:
        return False
    return f'__distribution__ = "{DISTRIBUTION}"' in ours.read_text(encoding="utf-8", errors="replace")


def make_app(help_text: str, group: type[Group]) -> typer.Typer:
    """A Typer app of a group, with the project's settings.

    Args:
        help_text: one sentence, shown above the commands.
        group: the group's class.
    """
    return typer.Typer(
        cls=group,
        help=help_text,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )


def add_command(app: typer.Typer, name: str, arguments: type[T], run: Callable[[T], None], example: str) -> None:
    """Add a command whose arguments are a dataclass's fields, so that a subclass adds to them.

    Args:
        app: the group.
        name: of the command.
        arguments: a dataclass with Typer's annotations; its docstring is the help.
        run: called with the values.
        example: a command line, shown below the help.
    """

    def call(**values: Any) -> None:  # Typer passes what the signature below names
        run(arguments(**values))

    hints = get_type_hints(arguments, include_extras=True)
    fields = inspect.signature(arguments).parameters.values()
    call.__signature__ = inspect.Signature([field.replace(annotation=hints[field.name]) for field in fields])  # type: ignore[attr-defined]
    call.__annotations__ = hints
    app.command(name, help=inspect.getdoc(arguments), epilog=f"Example: {example}")(call)


def command_line(group: str) -> str:
    """The command line that repeats this run, for the files that it writes.

    Args:
        group: the command's group; `python -m GROUP` leaves it out.
    """
    arguments = sys.argv[1:]
    return shlex.join([DISTRIBUTION, *(arguments if arguments[:1] == [group] else [group, *arguments])])
