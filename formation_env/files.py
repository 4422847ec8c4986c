"""Reading and hashing of regular files, and writing of files that are either complete or not there."""

import contextlib
import errno
import hashlib
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path


def read_regular_file(path: Path, max_bytes: int) -> bytes:
    """Read a regular file of bounded size; a pipe or a device is refused without waiting for it.

    Args:
        path: the file, or a link to it.
        max_bytes: largest size that is read.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger.
        ValueError: the path holds a null character.
    """
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    with path.open("rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes:,} bytes", str(path))
    return content


def hash_sources(paths: Iterable[Path]) -> str:
    """SHA-256 over the names and contents of files, hexadecimal."""
    total = hashlib.sha256()
    for path in paths:
        total.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to, which replaces `path` if the block ends without an exception.

    After an exception, an interrupt included, the old file is unchanged and the temporary file removed.

    Args:
        path: the file to replace; its folder must exist. The temporary file has the same suffix.

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
    """Permission bits that the process withholds from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write UTF-8 text files into a folder, each under its name only when all are complete.

    Args:
        folder: created if it does not exist.
        texts: file name -> content.

    Raises:
        OSError: the folder cannot be written.
    """
    write_files(folder, {name: text.encode() for name, text in texts.items()})


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write binary files into a folder, each under its name only when all are complete.

    Args:
        folder: created if it does not exist.
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
