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


def check_writable(folder: Path) -> None:
    """Find out before the work whether a folder can be made and written; leaves nothing behind.

    Args:
        folder: it need not exist; then its nearest existing parent is tried.

    Raises:
        OSError: it cannot; the error names the folder.
    """
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if os.path.lexists(parent))
    try:
        with tempfile.TemporaryDirectory(dir=nearest, prefix=".writable.") as scratch:
            (Path(scratch) / "probe").write_bytes(bytes(4096))  # a full disk still makes empty files
    except OSError as error:
        raise OSError(error.errno, f"cannot be written: {error.strerror or error}", str(folder)) from None


def is_checkout() -> bool:
    """Whether this is a checkout, whose configs/ and policies may be written, and no installed package."""
    return (Path(__file__).parents[1] / "pyproject.toml").is_file()
