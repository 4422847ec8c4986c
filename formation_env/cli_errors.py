"""Exit codes and one-line errors, the same for every command: 0 fine, 1 the work failed, 2 the input is wrong."""

import contextlib
import errno
import importlib.metadata
import re
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from typing import Any, Final, NoReturn

FAILED: Final = 1
"""The work failed: a disk, a worker process, a solver."""
WRONG_INPUT: Final = 2
"""The user must change something: an argument, a file, a library that is not installed."""
INTERRUPTED: Final = 130
"""Ctrl-C or SIGTERM; shells report Ctrl-C the same way."""
DISTRIBUTION: Final = "formation-env"
PACKAGES: Final = ("formation_env", "baselines", "agents")


class Interrupted(KeyboardInterrupt):
    """An interrupt with a message that says what is kept and how to continue."""


@contextlib.contextmanager
def on_interrupt(message: str) -> Iterator[None]:
    """Replace the message of an interrupt.

    Args:
        message: what is kept and how to continue, for instance "interrupted; the same command continues".
    """
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(message) from None


@contextlib.contextmanager
def one_line_errors() -> Iterator[None]:
    """End the program with one line on stderr and an exit code where the cause is not a bug.

    A bug keeps its traceback: `ValueError` and `RuntimeError` are taken for messages only if this project raised them.

    Raises:
        SystemExit: with `FAILED`, `WRONG_INPUT` or `INTERRUPTED`.
    """
    try:
        with _sigterm_as_interrupt(), _warnings_in_one_line():
            yield
    except KeyboardInterrupt as error:
        _end(str(error) or "interrupted, nothing written", INTERRUPTED)
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] in PACKAGES:
            raise
        _end(f"error: {missing_library(error)}", WRONG_INPUT)
    except BrokenExecutor:
        _end("error: a worker process died (killed, or out of memory); run again with fewer --processes", FAILED)
    except MemoryError:
        _end("error: out of memory; ask for fewer episodes, rows or processes", FAILED)
    except OSError as error:
        if error.errno == errno.EPIPE:
            raise  # the reader closed the pipe; typer ends quietly
        _end(f"error: {describe_os_error(error)}", FAILED)
    except ValueError as error:
        if not _is_message(error):
            raise
        _end(f"error: {error}", WRONG_INPUT)
    except RuntimeError as error:
        if not _is_message(error):
            raise
        _end(f"error: {error}", FAILED)


def missing_library(error: ModuleNotFoundError) -> str:
    """The library that is missing, and the command that installs it in a checkout."""
    library = (error.name or str(error)).split(".")[0]
    extra = _extra_of(library)
    install = f"pip install -e '.[{extra}]'" if extra else "pip install -e ."
    return f"needs {library}; in a checkout: {install}, or make"


def _extra_of(library: str) -> str:
    """The optional extra of this distribution that installs a library; empty if none does."""
    try:
        requirements = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        return ""
    wanted = library.replace("_", "-").lower()
    for requirement in requirements:
        name = re.match(r"[\w.-]+", requirement)
        extra = re.search(r"extra\s*==\s*['\"]([\w-]+)['\"]", requirement)
        if name and extra and name.group().replace("_", "-").lower() == wanted:
            return extra.group(1)
    return ""


def describe_os_error(error: OSError) -> str:
    """The path, if it is known, and the system's reason."""
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename else reason


def _is_message(error: Exception) -> bool:
    """Whether the error is a message to the user: a ConfigError, or raised explicitly by this project's code."""
    from formation_env.settings import ConfigError

    if isinstance(error, ConfigError):
        return True
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    module = frame.f_globals.get("__name__", "").partition(".")[0]
    return type(error) in (ValueError, RuntimeError) and module in PACKAGES


@contextlib.contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """Show warnings without the line of code that issued them."""

    def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
        if issubclass(category, UserWarning):
            print(f"warning: {message}", file=sys.stderr)
        else:
            before(message, category, *rest, **named)

    with warnings.catch_warnings():
        before = warnings.showwarning
        warnings.showwarning = show
        yield


@contextlib.contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """Treat SIGTERM as Ctrl-C, so that worker processes and temporary files are cleaned up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _interrupt(*_: Any) -> NoReturn:
    raise KeyboardInterrupt


def _end(message: str, code: int) -> NoReturn:
    print(message, file=sys.stderr)
    raise SystemExit(code)
