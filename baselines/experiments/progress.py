"""Progress of long work on stderr: a bar on a terminal, a line every ten seconds in a log file."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Protocol, TextIO

from tqdm import tqdm

LINE_INTERVAL_S: Final = 10.0
"""Time between two lines where stderr is no terminal."""
MAX_NAMES: Final = 3
"""Running jobs that are named; more do not fit on a line."""


class ProgressBar(Protocol):
    """Interface of a progress display."""

    def advance(self, amount: int) -> None:
        """Add work done since the last call."""
        ...

    def describe(self, text: str) -> None:
        """Say what is being done."""
        ...


@contextmanager
def progress_bar(total: int, title: str, unit: str = "step") -> Iterator[ProgressBar]:
    """Show the progress of some work on stderr.

    Args:
        total: amount of work.
        title: what the work is, in a word or two.
        unit: of the amount.
    """
    if sys.stderr.isatty():
        with tqdm(
            total=total, desc=title, unit=unit, unit_scale=True, smoothing=0.1, dynamic_ncols=True, file=sys.stderr
        ) as bar:
            yield _Terminal(bar)
    else:
        log = _Log(total, title, sys.stderr)
        yield log
        log.finish()


def in_words(names: list[str], more: int = 0) -> str:
    """The first few names of running jobs, and how many more there are."""
    rest = len(names) - MAX_NAMES + more if len(names) > MAX_NAMES else more
    return ", ".join(names[:MAX_NAMES]) + (f" and {rest} more" if rest > 0 else "")


class _Terminal:
    """A bar that is drawn again and again on one line."""

    def __init__(self, bar: "tqdm[Any]") -> None:
        self._bar = bar

    def advance(self, amount: int) -> None:
        self._bar.update(amount)

    def describe(self, text: str) -> None:
        self._bar.set_postfix_str(text)


class _Log:
    """Whole lines, for files and pipes."""

    def __init__(self, total: int, title: str, file: TextIO) -> None:
        self._total, self._title, self._file = total, title, file
        self._done, self._text = 0, ""
        self._start = self._last = time.monotonic()
        self._print(f"{title}: started")

    def advance(self, amount: int) -> None:
        self._done += amount
        self._show()

    def describe(self, text: str) -> None:
        self._text = text
        self._show()

    def finish(self) -> None:
        """Say how long it took."""
        self._print(f"{self._title}: done in {_clock(time.monotonic() - self._start)}")

    def _show(self) -> None:
        now = time.monotonic()
        if now - self._last < LINE_INTERVAL_S:
            return
        self._last, elapsed = now, now - self._start
        share = self._done / self._total if self._total else 1.0
        left = f", about {_clock(elapsed * (1 - share) / share)} left" if share > 0 else ""
        text = f"; {self._text}" if self._text else ""
        self._print(f"{self._title}: {share:.0%} after {_clock(elapsed)}{left}{text}")

    def _print(self, line: str) -> None:
        self._file.write(f"{line}\n")  # in one piece: an interrupt does not split it
        self._file.flush()


def _clock(seconds: float) -> str:
    """A duration as minutes and seconds, or hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
