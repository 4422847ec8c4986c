"""Files that are either complete or not there."""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it takes the place of `path` at the end, if nothing went wrong.

    Whatever goes wrong, an interrupt too, leaves the old file as it was and no temporary behind.

    Args:
        path: the file to replace; its folder must exist. The temporary has the same ending.

    Raises:
        OSError: the folder cannot be written.
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_mask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _mask() -> int:
    """The permissions that a new file does not get."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write text files into a folder, and rename them to their names only when all are complete.

    Args:
        folder: made if it does not exist.
        texts: file name -> content.

    Raises:
        OSError: the folder cannot be written.
    """
    write_files(folder, {name: text.encode() for name, text in texts.items()})


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """The same for files of any kind.

    Args:
        folder: made if it does not exist.
        contents: file name -> content.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        for name, content in contents.items():
            stack.enter_context(replacing(folder / name)).write_bytes(content)
